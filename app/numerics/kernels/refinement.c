/* Twin of app.numerics.refinement. */
#include "kernels.h"

#include <math.h>
#include <string.h>

/* The best place and its neighbours; 0 where they are not one unbroken row. */
int find_row(const Places *places, const double *step_m, ptrdiff_t roads, ptrdiff_t around,
             ptrdiff_t least, ptrdiff_t *first, ptrdiff_t *end)
{
    const double *score = places->values + SCORE * places->count;
    const double *at_m = places->values + CHAINAGE * places->count;
    ptrdiff_t best = 0;
    for (ptrdiff_t i = 1; i < places->count; i++)
        best = score[i] > score[best] ? i : best;
    *first = best > around ? best - around : 0;
    *end = best + around + 1 < places->count ? best + around + 1 : places->count;
    if (*end - *first < least || *end - *first < 2)
        return 0;
    ptrdiff_t last = *end - 1;
    int64_t road = places->road[best];
    if (road < 0 || road >= roads)
        return OUT_OF_BOUNDS;
    if (places->road[*first] != places->road[last] || places->sign[*first] != places->sign[last])
        return 0;
    double length_m = at_m[last] - at_m[*first];
    return fabs(length_m - (double)(last - *first) * step_m[road]) < 1e-6;
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

/* All places, those from `first` to `end - 1` drawn anew with `parts` to an interval. */
int redraw(const Told *told, const Along *along, const Places *places, ptrdiff_t first,
           ptrdiff_t end, ptrdiff_t parts, double step_m, double like_db2, int64_t *where,
           double *values)
{
    ptrdiff_t finer = parts * (end - first - 1) + 1, after = places->count - end;
    ptrdiff_t stride = first + finer + after;
    const double *chainage_m = places->values + CHAINAGE * places->count;
    for (ptrdiff_t cell = 0; cell < told->cells; cell++)
        if (told->numbers[cell] >= along->cells)
            return OUT_OF_BOUNDS;
    double start = rint(chainage_m[first] / step_m) + 1.0;
    if (!(fabs(start) < MOST_COLUMNS))
        return OUT_OF_BOUNDS;
    for (int row = 0; row < VALUES; row++) {
        const double *from = places->values + row * places->count;
        double *to = values + row * stride;
        memcpy(to, from, sizeof *to * (size_t)first);
        memcpy(to + first + finer - 1, from + end - 1, sizeof *to * (size_t)(after + 1));
    }
    for (ptrdiff_t i = 0; i < stride; i++) {
        ptrdiff_t from = i < first ? i : i < first + finer ? first : i - finer + (end - first);
        where[i] = places->road[from];
        where[stride + i] = places->sign[from];
    }
    for (ptrdiff_t i = first; i + 1 < end; i++) {
        double bend = bend_at(told, along, (ptrdiff_t)start + i - first, places->sign[first], step_m);
        divide(places, i, parts, bend, like_db2, values + first + (i - first) * parts, stride);
    }
    double *width_m = values + WIDTH * stride + first;
    for (ptrdiff_t i = 0; i < finer; i++)
        width_m[i] = step_m / (double)parts;
    width_m[0] = width_m[finer - 1] = step_m / 2.0 * (1.0 + 1.0 / (double)parts);
    return 0;
}
