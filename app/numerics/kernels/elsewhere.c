/* Twin of app.numerics.elsewhere. */
#include "kernels.h"
#include "levels.h"

#include <math.h>
#include <stdlib.h>

#define LARGE 1e200 /* products of a few more spreads still fit a double */

typedef struct {
    double product, log;
} Spreads;

static void multiply(Spreads *spreads, double spread)
{
    spreads->product *= spread;
    if (spreads->product > LARGE) {
        spreads->log += log(spreads->product);
        spreads->product = 1.0;
    }
}

static void hear(Filter *one, double level_db, double precision, Spreads *spreads)
{
    double spread = one->doubt_db2 * precision + 1.0, innovation = precision / spread;
    double gain = one->doubt_db2 * innovation;
    double missed_db = level_db - one->level_db, missed_one = 1.0 - one->one_db;
    one->squares += innovation * missed_db * missed_db;
    one->residual += innovation * missed_db * missed_one;
    one->weight += innovation * missed_one * missed_one;
    one->level_db += gain * missed_db;
    one->one_db += gain * missed_one;
    one->doubt_db2 *= 1.0 - gain;
    multiply(spreads, spread);
}

double filter_levels(const Levels *levels, double field_db2, double field_m, Filter *each)
{
    Spreads spreads = {1.0, 0.0};
    for (ptrdiff_t k = 0; k < levels->cells; k++)
        each[k] = (Filter){.doubt_db2 = field_db2};
    double last_m = 0.0, share = 1.0; /* most samples lie as far apart as the two before */
    for (ptrdiff_t row = 0; row < levels->samples; row++) {
        double apart_m = row > 0 ? levels->behind_m[row] - levels->behind_m[row - 1] : 0.0;
        if (apart_m != last_m)
            share = exp(-apart_m / field_m);
        last_m = apart_m;
        double grown_db2 = (1.0 - share * share) * field_db2;
        for (ptrdiff_t k = 0; k < levels->cells; k++) {
            Filter *one = each + k;
            one->level_db *= share;
            one->one_db *= share;
            one->doubt_db2 = share * share * one->doubt_db2 + grown_db2;
            double precision = levels->precision[row * levels->cells + k];
            if (precision > 0.0)
                hear(one, levels->level_db[row * levels->cells + k], precision, &spreads);
        }
    }
    return spreads.log + log(spreads.product);
}

double any_road(const Levels *levels, double mean_db2, double field_db2, double field_m,
                Filter *each)
{
    double sum = -filter_levels(levels, field_db2, field_m, each);
    Spreads spreads = {1.0, 0.0};
    for (ptrdiff_t k = 0; k < levels->cells; k++) {
        double told = 1.0 + mean_db2 * each[k].weight;
        sum += mean_db2 * each[k].residual * each[k].residual / told - each[k].squares;
        multiply(&spreads, told);
    }
    return 0.5 * (sum - spreads.log - log(spreads.product));
}

int weigh_elsewhere(const double *block, ptrdiff_t samples, ptrdiff_t cells, const Field *field,
                    double temperature, double *log_evidence)
{
    const double *weight = block + samples, *level_db = weight + samples;
    const double *heard = level_db + samples * cells;
    size_t readings = (size_t)(samples * cells);
    double *precision = malloc(readings * sizeof *precision + (size_t)cells * sizeof(Filter) + 1);
    if (!precision)
        return OUT_OF_MEMORY;
    double count = 0.0;
    for (ptrdiff_t row = 0; row < samples; row++)
        for (ptrdiff_t i = row * cells; i < (row + 1) * cells; i++) {
            double one = heard[i] * weight[row] / temperature;
            precision[i] = one / field->noise_db2;
            count += one;
        }
    Levels levels = {samples, cells, block, level_db, precision};
    *log_evidence = any_road(&levels, field->mean_db2, field->field_db2, field->field_m,
                             (Filter *)(precision + readings)) +
                    field->reading_log * count;
    free(precision);
    return 0;
}
