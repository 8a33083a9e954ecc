/* Twin of app.numerics.stretches.along: the fine scale, in double. */
#include "factors.h"
#include "settling.h"

#include <stdlib.h>
#include <string.h>

/* Where a sample lies: LANES columns from `at` on, `share` of the way to those `next` to them. */
typedef struct {
    ptrdiff_t at, next, columns;
    double share;
} Where;

/* Whether all columns are of the road, and whether samples lie between them: known when compiled. */
typedef struct {
    int inside, between;
} Kind;

/* A row's columns `at` to `at + LANES - 1`; beyond its ends lie its outermost ones. */
INLINE Lanes columns_of(const float *row, ptrdiff_t at, ptrdiff_t columns, int inside)
{
    if (inside) {
        row += at;
        return (Lanes){row[0], row[1], row[2], row[3]}; /* one instruction, where x86 has it */
    }
    Lanes some = {0};
    for (int lane = 0; lane < LANES; lane++) {
        ptrdiff_t within = at + lane < 0 ? 0 : at + lane;
        some[lane] = row[within < columns ? within : columns - 1];
    }
    return some;
}

INLINE Lanes load(const float *row, const Where *where, Kind kind)
{
    Lanes here = columns_of(row, where->at, where->columns, kind.inside);
    if (!kind.between)
        return here;
    Lanes there = columns_of(row, where->at + where->next, where->columns, kind.inside);
    return here + where->share * (there - here);
}

/* Adds one sample at LANES columns; the score that it returns holds no offset. */
INLINE Lanes add_sample(const Along *along, const Factors *f, ptrdiff_t i, const Where *at,
                        Kind kind, Own *own)
{
    ptrdiff_t columns = along->columns;
    Lanes score = f->outside[i] * load(along->rows + along->cells * TERMS * columns, at, kind);
    for (const Said *one = f->said + f->first[i]; one < f->said + f->first[i + 1]; one++) {
        const float *row = along->rows + one->cell * TERMS * columns;
        Lanes precision = load(row, at, kind);
        Lanes pull = load(row + columns, at, kind);
        Lanes fixed = load(row + 2 * columns, at, kind);
        Lanes logit = load(row + 3 * columns, at, kind);
        Lanes quiet = load(row + 4 * columns, at, kind);
        score += one->square * precision + one->level * pull;
        score += one->heard * (f->hearing * logit - 0.5 * fixed) + f->hearing * one->share * quiet;
        own[one->group].residual += one->level * precision - one->heard * pull;
        own[one->group].weight += one->heard * precision;
    }
    return score;
}

/* Scores, residuals and weights of the window ending at `column` and after; rows `stride` apart. */
FOR_EACH_MACHINE
static void lay_windows(const Along *along, const Factors *f, ptrdiff_t groups, ptrdiff_t column,
                        ptrdiff_t count, int sign, const Likelihood *likelihood, Own *own,
                        double *values, ptrdiff_t stride)
{
    Shares shares = {exp(likelihood->like_log), exp(likelihood->any_log)};
    for (ptrdiff_t i = 0; i < count; i += LANES) {
        Both sums = {{{0}, {0}, {0}}, {{0}, {0}, {0}}};
        memset(own, 0, sizeof *own * (size_t)groups);
        for (ptrdiff_t sample = 0; sample < f->samples; sample++) {
            Where where = {column + i - sign * f->behind[sample], -sign, along->columns,
                           f->share[sample]};
            if (where.at < 1 || where.at + LANES >= along->columns)
                sums.together[0] += add_sample(along, f, sample, &where, (Kind){0, 1}, own);
            else if (where.share == 0.0)
                sums.together[0] += add_sample(along, f, sample, &where, (Kind){1, 0}, own);
            else
                sums.together[0] += add_sample(along, f, sample, &where, (Kind){1, 1}, own);
        }
        take_groups(own, groups, likelihood, &sums);
        for (int lane = 0; lane < LANES && i + lane < count; lane++) {
            double said[4];
            settle(&sums, lane, likelihood, shares, said);
            for (int channel = 0; channel < 4; channel++)
                values[(SCORE + channel) * stride + i + lane] = said[channel];
        }
    }
}

/* A place for every grid position, after `at` others. */
int lay_stretch(const Laid *laid, const Likelihood *likelihood, const Room *room, ptrdiff_t at)
{
    double *values = room->values + at;
    ptrdiff_t count = laid->last - laid->first + 1, groups = laid->told.groups;
    for (ptrdiff_t i = 0; i < count; i++) {
        room->where[at + i] = laid->road;
        room->where[room->count + at + i] = laid->sign;
        values[CHAINAGE * room->count + i] = (double)(laid->first + i) * laid->step_m;
        values[WIDTH * room->count + i] = laid->step_m;
    }
    if (laid->last == laid->along.columns - 3)
        values[CHAINAGE * room->count + count - 1] = laid->length_m;
    Factors f = {0};
    int fault = aim(&f, &laid->told, laid->along.cells, laid->step_m, 0, likelihood);
    Own *own = malloc(sizeof *own * (size_t)groups);
    fault = fault == 0 && own == NULL ? OUT_OF_MEMORY : fault;
    if (fault == 0)
        lay_windows(&laid->along, &f, groups, laid->first + 1, count, (int)laid->sign, likelihood,
                    own, values, room->count);
    free(own);
    free(f.memory);
    return fault;
}
