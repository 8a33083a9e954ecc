/* What integrating offsets out adds, in double: app.numerics.offsets.take_offsets. */
#ifndef ROADPRINT_SETTLING_H
#define ROADPRINT_SETTLING_H

#include "approximate.h"
#include "kernels.h"

#include <math.h>

#define MOST_PRODUCT 1e200 /* of inflations, so that another one still fits a double */

enum { LANES = 4 };
typedef double Lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef double LooseLanes /* the same wherever it lies */
    __attribute__((vector_size(LANES * sizeof(double)), aligned(sizeof(double))));

/* Sums of one group. */
typedef struct {
    LooseLanes residual, weight;
} Own;

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

#endif
