/* What integrating offsets out adds, in float. */
#ifndef ROADPRINT_GAIN_H
#define ROADPRINT_GAIN_H

#include "approximate.h"
#include "kernels.h"

#include <math.h>

/* Twin of app.numerics.observation.offset_gain: the larger exponent taken out, one logarithm. */
INLINE float offset_gain(float residual, float weight, const Likelihood *likelihood,
                         float like_share, float any_share)
{
    float temperature = (float)likelihood->temperature;
    float squared = 0.5f * residual * residual / temperature;
    float like_db2 = (float)likelihood->like_db2, any_db2 = (float)likelihood->any_db2;
    float like = weight * like_db2 + 1.0f, any = weight * any_db2 + 1.0f;
    float first = squared * (like_db2 / like), second = squared * (any_db2 / any);
    float apart = first - second, less = exponential(apart < 0.0f ? apart : -apart);
    float mixed = like_share / sqrtf(like) * (apart < 0.0f ? less : 1.0f) +
                  any_share / sqrtf(any) * (apart < 0.0f ? 1.0f : less);
    return temperature * ((apart < 0.0f ? second : first) + logarithm(mixed));
}

/* Of one carrier: what its offset adds, and what is left of its residual and weight. */
INLINE float take_carrier(float *residual, float *weight, float carrier_db2, float temperature)
{
    float inflation = 1.0f + *weight * carrier_db2, left = 1.0f / inflation;
    float gain = 0.5f * *residual * *residual * carrier_db2 * left;
    *residual *= left;
    *weight *= left;
    return gain - 0.5f * temperature * logarithm(inflation);
}

#endif
