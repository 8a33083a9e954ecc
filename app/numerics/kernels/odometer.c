/* Twins of app.numerics.odometer: a window under factors of its travelled distance. */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>

typedef struct {
    int64_t road, sign;
    double at_m;
} Spot;

static int along_roads(const void *left, const void *right)
{
    const Spot *a = left, *b = right;
    if (a->road != b->road)
        return a->road < b->road ? -1 : 1;
    if (a->sign != b->sign)
        return a->sign < b->sign ? -1 : 1;
    return (a->at_m > b->at_m) - (a->at_m < b->at_m);
}

/* Places that carry mass, in order; how many they are. */
static ptrdiff_t heavy_spots(const Places *places, double least, Spot *spots)
{
    const double *score = places->values + SCORE * places->count;
    const double *at_m = places->values + CHAINAGE * places->count;
    ptrdiff_t count = 0;
    int ordered = 1;
    for (ptrdiff_t i = 0; i < places->count; i++) {
        if (!(score[i] >= least))
            continue;
        spots[count] = (Spot){places->road[i], places->sign[i], at_m[i]};
        ordered = ordered && (count == 0 || along_roads(spots + count - 1, spots + count) <= 0);
        count++;
    }
    if (!ordered)
        qsort(spots, (size_t)count, sizeof *spots, along_roads);
    return count;
}

/* Rows of grid positions about spots; none when they are longer than `heavy` has it. */
static ptrdiff_t join_spots(const Spot *spots, ptrdiff_t count, const double *step_m,
                            const int64_t *size, ptrdiff_t roads, const Heavy *heavy, Laid *found)
{
    ptrdiff_t rows = 0;
    double metres = 0.0;
    for (const Spot *one = spots; one < spots + count; one++) {
        if (one->road < 0 || one->road >= roads || size[one->road] < 1)
            return OUT_OF_BOUNDS;
        double step = step_m[one->road], from = (one->at_m - heavy->reach_m) / step;
        double to = (one->at_m + heavy->reach_m) / step;
        if (!(fabs(from) < MOST_COLUMNS && fabs(to) < MOST_COLUMNS))
            return OUT_OF_BOUNDS;
        ptrdiff_t first = from > 0.0 ? (ptrdiff_t)from : 0, last = (ptrdiff_t)to + 1;
        last = last < size[one->road] ? last : (ptrdiff_t)size[one->road] - 1;
        Laid *before = found + rows - 1;
        if (rows > 0 && before->road == one->road && before->sign == one->sign &&
            first <= before->last + 1) {
            metres += (double)(last - before->last) * step;
            before->last = last;
        } else {
            metres += (double)(last - first) * step;
            found[rows++] = (Laid){
                .road = one->road, .sign = one->sign, .first = first, .last = last};
        }
        if (metres > heavy->most_m)
            return 0;
    }
    return rows;
}

static double highest(const double *score, ptrdiff_t count)
{
    double top = -INFINITY;
    for (ptrdiff_t i = 0; i < count; i++)
        top = score[i] > top ? score[i] : top;
    return top;
}

/* How wide the peak is and, unless that is too wide, the stretches about the places that carry
 * mass; `found` has room for as many as there are places. */
ptrdiff_t stretches_about(const Places *places, const double *step_m, const int64_t *size,
                          ptrdiff_t roads, const Heavy *heavy, double *width_m, Laid *found)
{
    const double *score = places->values + SCORE * places->count;
    double top = highest(score, places->count);
    *width_m = 0.0;
    for (ptrdiff_t i = 0; i < places->count; i++)
        if (score[i] >= top - heavy->within)
            *width_m += places->values[WIDTH * places->count + i];
    if (*width_m > heavy->widest_m)
        return 0;
    Spot *spots = malloc(sizeof *spots * (size_t)places->count);
    if (spots == NULL)
        return OUT_OF_MEMORY;
    ptrdiff_t count = heavy_spots(places, top - heavy->lightest, spots);
    count = join_spots(spots, count, step_m, size, roads, heavy, found);
    free(spots);
    return count;
}

/* Every stretch under each of some factors; `behind_m` has room for a window's samples. */
static int lay_all(const Laid *stretches, ptrdiff_t count, const Hypotheses *factors,
                   ptrdiff_t first, const Likelihood *likelihood, double *behind_m,
                   const Room *room, ptrdiff_t at)
{
    int fault = 0;
    for (ptrdiff_t factor = first; factor < factors->count; factor++) {
        for (ptrdiff_t i = 0; i < stretches->told.samples; i++)
            behind_m[i] = stretches->told.behind_m[i] * factors->value[factor];
        for (const Laid *one = stretches; fault == 0 && one < stretches + count; one++) {
            Laid longer = *one;
            longer.told.behind_m = behind_m;
            fault = lay_stretch(&longer, likelihood, room, at);
            at += one->last - one->first + 1;
        }
    }
    return fault;
}

/* The stretch, of those under one factor, that holds a place. */
static const Laid *stretch_of(const Laid *stretches, ptrdiff_t place)
{
    while (place > stretches->last - stretches->first) {
        place -= stretches->last - stretches->first + 1;
        stretches++;
    }
    return stretches;
}

/* Draws one row anew, `at` places into the room; how many places it is now. */
static ptrdiff_t draw(const Laid *stretches, ptrdiff_t size, const Places *laid, const Row *row,
                      const Hypotheses *factors, double like_db2, ptrdiff_t parts,
                      double *behind_m, const Room *room, ptrdiff_t at)
{
    const Laid *one = stretch_of(stretches, row->first % size);
    ptrdiff_t finer = parts * (row->end - row->first - 1) + 1;
    Told longer = one->told;
    for (ptrdiff_t i = 0; i < longer.samples; i++)
        behind_m[i] = one->told.behind_m[i] * factors->value[row->first / size];
    longer.behind_m = behind_m;
    for (ptrdiff_t i = at; i < at + finer; i++) {
        room->where[i] = one->road;
        room->where[room->count + i] = one->sign;
    }
    int fault = draw_row(&longer, &one->along, laid, row->first, row->end, parts, one->step_m,
                         like_db2, room->values + at, room->count);
    return fault < 0 ? fault : finer;
}

/* What is known of the factors goes into the scores of their places, `at` others before them; it and
 * the factors are told, too. */
static void weigh(const Hypotheses *factors, ptrdiff_t size, const Row *rows, ptrdiff_t found,
                  ptrdiff_t parts, const Room *room, ptrdiff_t at, double *log_prior,
                  double *stretched)
{
    double *score = room->values + SCORE * room->count + at;
    for (ptrdiff_t factor = 0; factor < factors->count; factor++) {
        ptrdiff_t count = size;
        for (ptrdiff_t row = 0; row < found; row++)
            if (rows[row].first / size == factor)
                count += (parts - 1) * (rows[row].end - rows[row].first - 1);
        for (; count > 0; count--) {
            *score++ += factors->temperature * factors->log_prior[factor];
            *log_prior++ = factors->log_prior[factor];
            *stretched++ = factors->value[factor];
        }
    }
}

/* All laid places, those of the rows drawn anew; the rows stand last one first. */
static int draw_all(const Laid *stretches, ptrdiff_t size, const Places *laid, const Row *rows,
                    ptrdiff_t found, const Hypotheses *factors, double like_db2, ptrdiff_t parts,
                    double *behind_m, const Room *room, ptrdiff_t at)
{
    ptrdiff_t from = 0;
    for (const Row *row = rows + found - 1; row >= rows; row--) {
        copy_places(laid, from, row->first, room, at);
        at += row->first - from;
        from = row->end;
        ptrdiff_t finer = draw(stretches, size, laid, row, factors, like_db2, parts, behind_m,
                               room, at);
        if (finer < 0)
            return (int)finer;
        at += finer;
    }
    copy_places(laid, from, laid->count, room, at);
    return 0;
}

/* Whether one of the stretches, which stand in order, holds a place or ends half a step from it. */
static int within(const Laid *stretches, ptrdiff_t count, const Spot *spot)
{
    const Laid *low = stretches, *high = stretches + count;
    while (low < high) {
        const Laid *one = low + (high - low) / 2;
        Spot first = {one->road, one->sign, ((double)one->first - 0.5) * one->step_m};
        if (along_roads(&first, spot) > 0) {
            high = one;
            continue;
        }
        Spot last = {one->road, one->sign, ((double)one->last + 0.5) * one->step_m};
        if (along_roads(spot, &last) <= 0)
            return 1;
        low = one + 1;
    }
    return 0;
}

/* Places that were not laid again, the first in the room, stand for every factor: the log of what
 * these are together. */
static double stand_for_all(const Laid *stretches, ptrdiff_t count, const Hypotheses *factors,
                            const Places *before, ptrdiff_t straight, const Room *room)
{
    double together = 0.0, *score = room->values + SCORE * room->count;
    for (ptrdiff_t factor = 0; factor < factors->count; factor++)
        together += exp(factors->log_prior[factor]);
    together = log1p(together);
    const double *at_m = before->values + CHAINAGE * before->count;
    for (ptrdiff_t i = 0; i < before->count; i++) {
        Spot spot = {before->road[i], before->sign[i], at_m[i]};
        if (i >= straight || !within(stretches, count, &spot))
            score[i] += factors->temperature * together;
    }
    return together;
}

/* Which side's farther factors are worth a look, 0 or 1; -1 = none. Twin of `farther_of`. */
static int side_of(const Hypotheses *factors, const double *score, ptrdiff_t size, double top)
{
    double first = 0.0, last = 0.0;
    for (ptrdiff_t factor = 0; factor < factors->count; factor++) {
        last = highest(score + factor * size, size) / factors->temperature;
        last += factors->log_prior[factor];
        first = factor == 0 ? last : first;
        top = last > top ? last : top;
    }
    if (factors->farther == 0 || (first > last ? first : last) < top - factors->from)
        return -1;
    return first >= last ? 0 : 1;
}

/* The factors that were looked at anyhow, and those of one side after them. */
static void move_beside(Hypotheses *factors, int side, double *copy)
{
    ptrdiff_t near = factors->count, more = side < 0 ? 0 : factors->farther;
    double *value = copy, *log_prior = copy + near + factors->farther;
    for (ptrdiff_t i = 0; i < near + more; i++) {
        ptrdiff_t from = i < near ? i : i + side * more;
        value[i] = factors->value[from];
        log_prior[i] = factors->log_prior[from];
    }
    factors->value = value;
    factors->log_prior = log_prior;
    factors->count = near + more;
}

/*
 * The places before, then those of every stretch under every factor, their peaks drawn anew and
 * what is known of their factors in their scores; how many the latter are. Of the places before the
 * first lie along single roads. The room is on the way in as large as it may become, and then as
 * large as it has become.
 */
ptrdiff_t lay_factors(const Laid *stretches, ptrdiff_t count, const Hypotheses *given,
                      const Likelihood *likelihood, const Drawing *drawing, const Places *before,
                      ptrdiff_t straight, Room *room, double *log_prior, double *stretched,
                      double *together)
{
    ptrdiff_t size = 0, samples = stretches->told.samples, parts = drawing->parts, found = 0;
    for (ptrdiff_t i = 0; i < count; i++)
        size += stretches[i].last - stretches[i].first + 1;
    ptrdiff_t kinds = given->count + given->farther, most = room->count;
    Room near = {size * given->count, NULL, NULL}, all = {size * kinds, NULL, NULL};
    size_t places = (size_t)(near.count + all.count);
    double *memory = malloc(sizeof *memory * ((size_t)(samples + 2 * kinds) + VALUES * places) +
                            sizeof(int64_t) * 2 * places +
                            sizeof(Row) * (size_t)(drawing->most + 1));
    if (memory == NULL)
        return OUT_OF_MEMORY;
    near.values = memory + samples + 2 * kinds;
    all.values = near.values + VALUES * near.count;
    near.where = (int64_t *)(all.values + VALUES * all.count);
    all.where = near.where + 2 * near.count;
    Row *rows = (Row *)(all.where + 2 * all.count);
    Hypotheses factors = *given;
    Places laid = {near.count, near.where, near.where + near.count, near.values};
    ptrdiff_t fault = lay_all(stretches, count, &factors, 0, likelihood, memory, &near, 0);
    double top = highest(before->values + SCORE * before->count, before->count);
    int side = fault < 0 ? -1 : side_of(given, near.values + SCORE * near.count, size,
                                        top / given->temperature);
    move_beside(&factors, side, memory + samples);
    if (side >= 0) {
        copy_places(&laid, 0, laid.count, &all, 0);
        fault = lay_all(stretches, count, &factors, given->count, likelihood, memory, &all,
                        near.count);
        laid = (Places){all.count, all.where, all.where + all.count, all.values};
    }
    if (fault == 0)
        fault = found = find_rows(&laid, drawing->step_m, drawing->roads, drawing->lowest,
                                  drawing->around, drawing->least, drawing->most, rows);
    room->count = before->count + laid.count;
    for (ptrdiff_t i = 0; i < found; i++)
        room->count += (parts - 1) * (rows[i].end - rows[i].first - 1);
    if (fault >= 0 && room->count > most)
        fault = OUT_OF_BOUNDS;
    if (fault >= 0) {
        copy_places(before, 0, before->count, room, 0);
        fault = draw_all(stretches, size, &laid, rows, found, &factors, likelihood->like_db2,
                         parts, memory, room, before->count);
    }
    if (fault >= 0)
        *together = stand_for_all(stretches, count, &factors, before, straight, room);
    if (fault >= 0)
        weigh(&factors, size, rows, found, parts, room, before->count, log_prior, stretched);
    free(memory);
    return fault < 0 ? fault : room->count - before->count;
}
