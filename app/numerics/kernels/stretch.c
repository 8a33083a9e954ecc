/* Twin of app.numerics.stretches.along: the fine scale, in double. */
#include "approximate.h"
#include "factors.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOST_PRODUCT 1e200 /* of inflations, so that another one still fits a double */

enum { LANES = 4 };
typedef double Lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef double LooseLanes /* the same wherever it lies */
    __attribute__((vector_size(LANES * sizeof(double)), aligned(sizeof(double))));

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

/* Sums of one group. */
typedef struct {
    LooseLanes residual, weight;
} Own;

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

/* Sums of all samples: score, residual and weight; twice, without and with offsets of groups. */
typedef struct {
    Lanes together[3], apart[3];
} Both;

/* What the groups' offsets take of their sums; the rest is added to those of all. */
INLINE void take_groups(const Own *own, ptrdiff_t groups, const Likelihood *likelihood, Both *sums)
{
    Lanes product = {1.0, 1.0, 1.0, 1.0}, logs = {0};
    for (const Own *one = own; one < own + groups; one++) {
        Lanes inflation = 1.0 + one->weight * likelihood->group_db2, left = 1.0 / inflation;
        sums->apart[0] += 0.5 * likelihood->group_db2 * one->residual * one->residual * left;
        sums->apart[1] += one->residual * left;
        sums->apart[2] += one->weight * left;
        sums->together[1] += one->residual;
        sums->together[2] += one->weight;
        product *= inflation;
        for (int lane = 0; lane < LANES; lane++)
            if (product[lane] > MOST_PRODUCT || one == own + groups - 1) {
                logs[lane] += log(product[lane]);
                product[lane] = 1.0;
            }
    }
    sums->apart[0] -= 0.5 * likelihood->temperature * logs;
}

/* Log of two shares' mean of exponentials: the larger exponent taken out. */
INLINE double log_mean(double first, double first_share, double second, double second_share)
{
    double less = exp(-fabs(first - second));
    double mine = first_share * (first < second ? less : 1.0);
    double other = second_share * (first < second ? 1.0 : less);
    return fmax(first, second) + log(mine + other);
}

/* Of the hypotheses of an OffsetPrior, not as logarithms. */
typedef struct {
    double like, any;
} Shares;

INLINE double precise_gain(double residual, double weight, const Likelihood *likelihood,
                           Shares shares)
{
    double squared = 0.5 * residual * residual / likelihood->temperature;
    double like = weight * likelihood->like_db2 + 1.0, any = weight * likelihood->any_db2 + 1.0;
    return likelihood->temperature *
           log_mean(squared * (likelihood->like_db2 / like), shares.like / sqrt(like),
                    squared * (likelihood->any_db2 / any), shares.any / sqrt(any));
}

/* Twin of app.numerics.offsets.take_offsets: the score, what is left to the device, and how
 * probably groups are apart. */
INLINE void settle(const Both *sums, int lane, const Likelihood *likelihood, Shares shares,
                   double said[4])
{
    const Lanes *together = sums->together, *apart = sums->apart;
    const Lanes *left = likelihood->apart < 1.0 ? together : apart;
    said[3] = 1.0;
    double gain = precise_gain(apart[1][lane], apart[2][lane], likelihood, shares) + apart[0][lane];
    if (likelihood->apart < 1.0) {
        double temperature = likelihood->temperature;
        double all = precise_gain(together[1][lane], together[2][lane], likelihood, shares);
        double both = log_mean(all / temperature, 1.0 - likelihood->apart, gain / temperature,
                               likelihood->apart);
        said[3] = likelihood->apart * exp(gain / temperature - both);
        gain = temperature * both;
    }
    said[0] = together[0][lane] + gain;
    said[1] = left[1][lane];
    said[2] = left[2][lane];
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
