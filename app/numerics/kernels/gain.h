/* What integrating offsets out adds, in float. */
#ifndef ROADPRINT_GAIN_H
#define ROADPRINT_GAIN_H

#include "approximate.h"
#include "kernels.h"

#include <math.h>

/*
 * Sums at columns that groups are added to: residual and weight as if no group had an offset; then
 * what their offsets add, and what they leave of residual and weight.
 */
enum { TAKEN = 5 };

/* Of the hypotheses of an OffsetPrior, not as logarithms. */
typedef struct {
    float like, any, together, apart;
} Shares;

INLINE Shares shares_of(const Likelihood *likelihood)
{
    return (Shares){(float)exp(likelihood->like_log), (float)exp(likelihood->any_log),
                    (float)(1.0 - likelihood->apart), (float)likelihood->apart};
}

/* Adds what one group's offset takes at columns; the group's own sums are cleared. */
INLINE void take_group(float *restrict residual, float *restrict weight, ptrdiff_t count,
                       const Likelihood *likelihood, float *restrict all_residual,
                       float *restrict all_weight, float *restrict gain,
                       float *restrict left_residual, float *restrict left_weight)
{
    float group_db2 = (float)likelihood->group_db2, temperature = (float)likelihood->temperature;
    for (ptrdiff_t i = 0; i < count; i++) {
        float inflation = 1.0f + weight[i] * group_db2, left = 1.0f / inflation;
        float squared = 0.5f * residual[i] * residual[i] * group_db2 * left;
        all_residual[i] += residual[i];
        all_weight[i] += weight[i];
        gain[i] += squared - 0.5f * temperature * logarithm(inflation);
        left_residual[i] += residual[i] * left;
        left_weight[i] += weight[i] * left;
        residual[i] = weight[i] = 0.0f;
    }
}

/* Log of two shares' mean of exponentials: the larger exponent taken out. */
INLINE float log_mean(float first, float first_share, float second, float second_share)
{
    float apart = first - second, less = exponential(apart < 0.0f ? apart : -apart);
    float mixed = first_share * (apart < 0.0f ? less : 1.0f) +
                  second_share * (apart < 0.0f ? 1.0f : less);
    return (apart < 0.0f ? second : first) + logarithm(mixed);
}

/* Twin of app.numerics.offsets.offset_gain. */
INLINE float offset_gain(float residual, float weight, const Likelihood *likelihood, Shares shares)
{
    float temperature = (float)likelihood->temperature;
    float squared = 0.5f * residual * residual / temperature;
    float like_db2 = (float)likelihood->like_db2, any_db2 = (float)likelihood->any_db2;
    float like = weight * like_db2 + 1.0f, any = weight * any_db2 + 1.0f;
    return temperature * log_mean(squared * (like_db2 / like), shares.like / sqrtf(like),
                                  squared * (any_db2 / any), shares.any / sqrtf(any));
}

/* Twin of app.numerics.offsets.take_offsets: adds what offsets give to scores at columns. */
INLINE void add_gain(float *restrict score, ptrdiff_t count, const Likelihood *likelihood,
                     const float *restrict all_residual, const float *restrict all_weight,
                     const float *restrict gain, const float *restrict left_residual,
                     const float *restrict left_weight)
{
    Shares shares = shares_of(likelihood);
    float temperature = (float)likelihood->temperature, cooled = 1.0f / temperature;
    if (shares.together == 0.0f) {
        for (ptrdiff_t i = 0; i < count; i++)
            score[i] += gain[i] + offset_gain(left_residual[i], left_weight[i], likelihood, shares);
        return;
    }
    for (ptrdiff_t i = 0; i < count; i++) {
        float together = offset_gain(all_residual[i], all_weight[i], likelihood, shares);
        float apart = gain[i] + offset_gain(left_residual[i], left_weight[i], likelihood, shares);
        score[i] += temperature * log_mean(together * cooled, shares.together, apart * cooled,
                                           shares.apart);
    }
}

#endif
