/* Twin of app.numerics.refinement. */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Whether place i and the next lie one step of the grid apart on one road, one way. */
static int joined(const Places *places, const double *step_m, ptrdiff_t i)
{
    const double *at_m = places->values + CHAINAGE * places->count;
    return places->road[i] == places->road[i + 1] && places->sign[i] == places->sign[i + 1] &&
           fabs(at_m[i + 1] - at_m[i] - step_m[places->road[i]]) < 1e-6;
}

static int is_peak(const Places *places, const double *step_m, ptrdiff_t i)
{
    const double *score = places->values + SCORE * places->count;
    if (i > 0 && joined(places, step_m, i - 1) && !(score[i] > score[i - 1]))
        return 0;
    return i + 1 == places->count || !joined(places, step_m, i) || score[i] >= score[i + 1];
}

static int taken(const Row *rows, ptrdiff_t count, ptrdiff_t i)
{
    for (ptrdiff_t row = 0; row < count; row++)
        if (rows[row].first <= i && i < rows[row].end)
            return 1;
    return 0;
}

static Row row_about(const Places *places, const double *step_m, ptrdiff_t peak, ptrdiff_t around,
                     const Row *rows, ptrdiff_t count)
{
    Row row = {peak, peak + 1};
    while (row.first > 0 && row.first > peak - around && joined(places, step_m, row.first - 1) &&
           !taken(rows, count, row.first - 1))
        row.first--;
    while (row.end < places->count && row.end < peak + around + 1 &&
           joined(places, step_m, row.end - 1) && !taken(rows, count, row.end))
        row.end++;
    return row;
}

static int later(const void *left, const void *right)
{
    const Row *a = left, *b = right;
    return (a->first < b->first) - (a->first > b->first);
}

/* Rows about the peaks that matter, the last one first; how many they are. */
ptrdiff_t find_rows(const Places *places, const double *step_m, ptrdiff_t roads, double lowest,
                    ptrdiff_t around, ptrdiff_t least, ptrdiff_t most, Row *rows)
{
    const double *score = places->values + SCORE * places->count;
    double top = -INFINITY;
    for (ptrdiff_t i = 0; i < places->count; i++) {
        if (places->road[i] < 0 || places->road[i] >= roads)
            return OUT_OF_BOUNDS;
        top = score[i] > top ? score[i] : top;
    }
    double lowered = INFINITY; /* peaks are chosen in falling order: this is the one before */
    ptrdiff_t before = -1, count = 0;
    while (count < most) {
        ptrdiff_t peak = -1;
        for (ptrdiff_t i = 0; i < places->count; i++)
            if (score[i] >= top - lowest && (peak < 0 || score[i] > score[peak]) &&
                (score[i] < lowered || (score[i] == lowered && i > before)) &&
                is_peak(places, step_m, i))
                peak = i;
        if (peak < 0)
            break;
        lowered = score[peak];
        before = peak;
        if (taken(rows, count, peak))
            continue;
        Row row = row_about(places, step_m, peak, around, rows, count);
        if (row.end - row.first >= least && row.end - row.first >= 2)
            rows[count++] = row;
    }
    qsort(rows, (size_t)count, sizeof *rows, later);
    return count;
}

/* How far the score lies above the straight line from one grid position to the next. */
static double bend_at(const Told *told, const Along *along, ptrdiff_t column, int64_t sign,
                      double step_m)
{
    double bend = 0.0;
    for (ptrdiff_t i = 0; i < told->samples; i++) {
        double at = (double)column - (double)sign * rint(told->behind_m[i] * (1.0 / step_m));
        at = at > 0.0 ? at : 0.0;
        at = at < (double)(along->columns - 1) ? at : (double)(along->columns - 1);
        for (ptrdiff_t cell = 0; cell < told->cells; cell++)
            if (told->numbers[cell] >= 0)
                bend += told->heard[i * told->cells + cell] * told->weight[i] *
                        along->bend[told->numbers[cell] * along->columns + (ptrdiff_t)at];
    }
    return bend;
}

/* Places at every share of the way from one grid position to the next. */
static void divide(const Places *places, ptrdiff_t left, ptrdiff_t parts, double bend,
                   double like_db2, double *values, ptrdiff_t stride)
{
    const double *from = places->values + left;
    double step = from[RESIDUAL * places->count + 1] - from[RESIDUAL * places->count];
    double weight = from[WEIGHT * places->count];
    /* The offset takes up a common residual, whose square is convex: so much less is the bend. */
    double taken = 0.5 * step * step / (weight + 1.0 / like_db2);
    for (ptrdiff_t part = 0; part < parts; part++) {
        double share = (double)part / (double)parts;
        for (int row = 0; row < VALUES; row++) {
            const double *ends = from + row * places->count;
            values[row * stride + part] = ends[0] + share * (ends[1] - ends[0]);
        }
        values[SCORE * stride + part] += (bend - taken) * (share * (1.0 - share));
    }
}

/* The row from `first` to `end - 1` drawn anew with `parts` to an interval; all but where it is. */
int draw_row(const Told *told, const Along *along, const Places *places, ptrdiff_t first,
             ptrdiff_t end, ptrdiff_t parts, double step_m, double like_db2, double *values,
             ptrdiff_t stride)
{
    ptrdiff_t finer = parts * (end - first - 1) + 1;
    for (ptrdiff_t cell = 0; cell < told->cells; cell++)
        if (told->numbers[cell] >= along->cells)
            return OUT_OF_BOUNDS;
    double start = rint(places->values[CHAINAGE * places->count + first] / step_m) + 1.0;
    if (!(fabs(start) < MOST_COLUMNS))
        return OUT_OF_BOUNDS;
    for (ptrdiff_t i = first; i + 1 < end; i++) {
        double bend = bend_at(told, along, (ptrdiff_t)start + i - first, places->sign[first], step_m);
        divide(places, i, parts, bend, like_db2, values + (i - first) * parts, stride);
    }
    for (int row = 0; row < VALUES; row++)
        values[row * stride + finer - 1] = places->values[row * places->count + end - 1];
    double *width_m = values + WIDTH * stride;
    for (ptrdiff_t i = 0; i < finer; i++)
        width_m[i] = step_m / (double)parts;
    width_m[0] = width_m[finer - 1] = step_m / 2.0 * (1.0 + 1.0 / (double)parts);
    return 0;
}

/* Some of the places, after `at` others. */
void copy_places(const Places *places, ptrdiff_t first, ptrdiff_t end, const Room *room,
                 ptrdiff_t at)
{
    size_t count = (size_t)(end - first);
    memcpy(room->where + at, places->road + first, sizeof *room->where * count);
    memcpy(room->where + room->count + at, places->sign + first, sizeof *room->where * count);
    for (int row = 0; row < VALUES; row++)
        memcpy(room->values + row * room->count + at, places->values + row * places->count + first,
               sizeof *room->values * count);
}

/* All places, those from `first` to `end - 1` drawn anew with `parts` to an interval. */
int redraw(const Told *told, const Along *along, const Places *places, ptrdiff_t first,
           ptrdiff_t end, ptrdiff_t parts, double step_m, double like_db2, const Room *room)
{
    ptrdiff_t finer = parts * (end - first - 1) + 1;
    copy_places(places, 0, first, room, 0);
    copy_places(places, end, places->count, room, first + finer);
    for (ptrdiff_t i = first; i < first + finer; i++) {
        room->where[i] = places->road[first];
        room->where[room->count + i] = places->sign[first];
    }
    return draw_row(told, along, places, first, end, parts, step_m, like_db2,
                    room->values + first, room->count);
}
