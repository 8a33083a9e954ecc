/* Twin of app.numerics.observation.evidence and sample_weight, and of app.numerics.listing. */
#include "kernels.h"

#include <math.h>
#include <string.h>

static double stretch_of(const double *distance_m, ptrdiff_t samples, ptrdiff_t i, double step_m)
{
    return floor((distance_m[samples - 1] - distance_m[i]) / step_m + 0.5);
}

ptrdiff_t count_stretches(const double *distance_m, ptrdiff_t samples, double step_m)
{
    ptrdiff_t count = 1;
    for (ptrdiff_t i = samples - 1; i > 0; i--)
        count += stretch_of(distance_m, samples, i, step_m) !=
                 stretch_of(distance_m, samples, i - 1, step_m);
    return count;
}

static void weigh(const double *behind_m, ptrdiff_t count, double correlation_m, double *weight)
{
    for (ptrdiff_t i = 0; i < count; i++) {
        double before = i > 0 ? behind_m[i] - behind_m[i - 1] : behind_m[1] - behind_m[0];
        double after = i + 1 < count ? behind_m[i + 1] - behind_m[i] : before;
        double share = 0.5 * (before + after) * (1.0 / correlation_m);
        weight[i] = share < 1.0 ? share : 1.0;
    }
}

/* Each cell's part of all that was heard of its carrier; few cells, so that pairs cost nothing. */
static void divide(const double *heard, const ptrdiff_t *carrier, ptrdiff_t cells, double *share)
{
    for (ptrdiff_t k = 0; k < cells; k++) {
        double all = 0.0;
        for (ptrdiff_t other = 0; heard[k] > 0.0 && other < cells; other++)
            all += carrier[other] == carrier[k] ? heard[other] : 0.0;
        share[k] = heard[k] > 0.0 ? heard[k] / all : 0.0;
    }
}

/* block: behind_m, weight, then level_db, heard and share, sample by sample. */
void gather_evidence(const double *distance_m, const double *rsrp_dbm, ptrdiff_t samples,
                     ptrdiff_t width, const ptrdiff_t *columns, const ptrdiff_t *carrier,
                     ptrdiff_t cells, double step_m, double centre_dbm, double correlation_m,
                     ptrdiff_t stretches, double *block)
{
    double *behind_m = block, *weight = block + stretches;
    double *level_db = weight + stretches, *heard = level_db + stretches * cells;
    double *share = heard + stretches * cells;
    memset(block, 0, sizeof *block * (size_t)(stretches * (2 + 3 * cells)));
    ptrdiff_t row = 0, newest = samples - 1;
    for (ptrdiff_t i = samples - 1; i >= 0; i--) {
        behind_m[row] += distance_m[samples - 1] - distance_m[i];
        for (ptrdiff_t k = 0; k < cells; k++) {
            double rsrp = rsrp_dbm[i * width + columns[k]];
            if (!isnan(rsrp)) {
                level_db[row * cells + k] += rsrp - centre_dbm;
                heard[row * cells + k] += 1.0;
            }
        }
        if (i > 0 && stretch_of(distance_m, samples, i, step_m) ==
                         stretch_of(distance_m, samples, i - 1, step_m))
            continue;
        double readings = (double)(newest - i + 1);
        behind_m[row] /= readings;
        for (ptrdiff_t k = row * cells; k < (row + 1) * cells; k++) {
            level_db[k] /= heard[k] > 1.0 ? heard[k] : 1.0;
            heard[k] /= readings;
        }
        divide(heard + row * cells, carrier, cells, share + row * cells);
        row++;
        newest = i - 1;
    }
    if (stretches == 1)
        weight[0] = 1.0;
    else
        weigh(behind_m, stretches, correlation_m, weight);
}

double listen_to(double *block, ptrdiff_t samples, ptrdiff_t cells, const double *usual,
                 double few, double enough, double least, double *readings)
{
    const double *weight = block + samples, *heard = block + (2 + cells) * samples;
    double *share = block + (2 + 2 * cells) * samples, listed = 0.0, usually = 0.0;
    for (ptrdiff_t i = 0; i < samples; i++)
        for (ptrdiff_t k = 0; k < cells; k++) {
            listed += weight[i] * heard[i * cells + k];
            usually += weight[i] * share[i * cells + k] * usual[k];
        }
    *readings = listed;
    if (!(usually > 0.0))
        return 1.0;
    double times = listed / usually;
    double counts = fmin(fmax((times - few) / (enough - few), least), 1.0);
    for (ptrdiff_t place = 0; counts < 1.0 && place < samples * cells; place++)
        share[place] *= counts;
    return times;
}
