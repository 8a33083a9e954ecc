/* Twin of app.numerics.stretches.along: the fine scale, in double. */
#include "factors.h"
#include "settling.h"

#include <stdlib.h>
#include <string.h>

/* A row's columns `at` to `at + LANES - 1`; beyond its ends lie its outermost ones. */
INLINE Lanes load(const float *row, ptrdiff_t at, ptrdiff_t columns, int inside)
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

/* Adds one sample at LANES columns; the score that it returns holds no offset. */
INLINE Lanes add_sample(const Along *along, const Factors *f, ptrdiff_t i, ptrdiff_t at, int inside,
                        Own *own)
{
    ptrdiff_t columns = along->columns;
    Lanes score = f->outside[i] * load(along->rows + along->cells * TERMS * columns, at, columns, inside);
    for (const Said *one = f->said + f->first[i]; one < f->said + f->first[i + 1]; one++) {
        const float *row = along->rows + one->cell * TERMS * columns;
        Lanes precision = load(row, at, columns, inside);
        Lanes pull = load(row + columns, at, columns, inside);
        Lanes fixed = load(row + 2 * columns, at, columns, inside);
        Lanes logit = load(row + 3 * columns, at, columns, inside);
        Lanes quiet = load(row + 4 * columns, at, columns, inside);
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
            ptrdiff_t at = column + i - sign * f->behind[sample];
            int inside = at >= 0 && at + LANES <= along->columns;
            sums.together[0] += inside ? add_sample(along, f, sample, at, 1, own)
                                       : add_sample(along, f, sample, at, 0, own);
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
