/* Twin of app.numerics.elsewhere.log_evidence. */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>

#define LARGE 1e200 /* products of a few more spreads still fit a double */

/* What is known of a cell's field and its sums so far. */
typedef struct {
    double level_db, one_db, doubt_db2, squares, residual, weight;
} Filter;

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

static void hear(Filter *one, double level_db, double count, double noise_db2, Spreads *spreads)
{
    double spread = one->doubt_db2 * count / noise_db2 + 1.0;
    double precision = count / (noise_db2 * spread), gain = one->doubt_db2 * precision;
    double missed_db = level_db - one->level_db, missed_one = 1.0 - one->one_db;
    one->squares += precision * missed_db * missed_db;
    one->residual += precision * missed_db * missed_one;
    one->weight += precision * missed_one * missed_one;
    one->level_db += gain * missed_db;
    one->one_db += gain * missed_one;
    one->doubt_db2 *= 1.0 - gain;
    multiply(spreads, spread);
}

int weigh_elsewhere(const double *block, ptrdiff_t samples, ptrdiff_t cells, const Field *field,
                    double *log_evidence)
{
    const double *behind_m = block, *weight = block + samples;
    const double *level_db = weight + samples, *heard = level_db + samples * cells;
    Filter *each = calloc((size_t)(cells > 0 ? cells : 1), sizeof *each);
    if (!each)
        return OUT_OF_MEMORY;
    for (ptrdiff_t k = 0; k < cells; k++)
        each[k].doubt_db2 = field->field_db2;
    double readings = 0.0, sum = 0.0;
    Spreads spreads = {1.0, 0.0};
    for (ptrdiff_t row = 0; row < samples; row++) {
        double apart_m = row > 0 ? behind_m[row] - behind_m[row - 1] : 0.0;
        double share = exp(-apart_m / field->field_m), grown_db2 = (1.0 - share * share) * field->field_db2;
        for (ptrdiff_t k = 0; k < cells; k++) {
            Filter *one = each + k;
            one->level_db *= share;
            one->one_db *= share;
            one->doubt_db2 = share * share * one->doubt_db2 + grown_db2;
            double count = heard[row * cells + k] * weight[row] / field->temperature;
            if (count > 0.0)
                hear(one, level_db[row * cells + k], count, field->noise_db2, &spreads);
            readings += count;
        }
    }
    for (ptrdiff_t k = 0; k < cells; k++) {
        double told = 1.0 + field->mean_db2 * each[k].weight;
        sum += field->mean_db2 * each[k].residual * each[k].residual / told - each[k].squares;
        multiply(&spreads, told);
    }
    free(each);
    sum -= spreads.log + log(spreads.product);
    *log_evidence = 0.5 * sum + field->reading_log * readings;
    return 0;
}
