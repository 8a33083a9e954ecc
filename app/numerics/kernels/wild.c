/* Twin of app.numerics.wild. */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_ABOUT = 9 };

/* What is known so far: levels heard of one cell, where, and all steps between near ones. */
typedef struct {
    double *level_dbm, *at_m, *step_db;
    ptrdiff_t heard, steps;
} Heard;

static int rising(const void *one, const void *other)
{
    double first = *(const double *)one, second = *(const double *)other;
    return (first > second) - (first < second);
}

/* Of a few numbers, which it sorts. */
static double median_of(double *few, ptrdiff_t count)
{
    for (ptrdiff_t i = 1; i < count; i++) {
        double one = few[i];
        ptrdiff_t at = i;
        for (; at > 0 && few[at - 1] > one; at--)
            few[at] = few[at - 1];
        few[at] = one;
    }
    return 0.5 * (few[(count - 1) / 2] + few[count / 2]);
}

static void hear(Heard *known, const double *distance_m, const double *rsrp_dbm, ptrdiff_t samples,
                 ptrdiff_t width, const Hampel *filter)
{
    known->heard = 0;
    for (ptrdiff_t i = 0; i < samples; i++) {
        double level_dbm = rsrp_dbm[i * width];
        if (isnan(level_dbm))
            continue;
        ptrdiff_t at = known->heard++;
        known->level_dbm[at] = level_dbm;
        known->at_m[at] = distance_m[i];
        if (at > 0 && distance_m[i] - known->at_m[at - 1] <= filter->reach_m)
            known->step_db[known->steps++] = fabs(level_dbm - known->level_dbm[at - 1]);
    }
}

/* How far a reading strays from the median about it, 0 where all are alike; NaN where too few are
 * near. */
static double stray(const Heard *known, ptrdiff_t at, const Hampel *filter)
{
    double about[MOST_ABOUT], least_dbm = known->level_dbm[at], most_dbm = least_dbm;
    ptrdiff_t near = 0;
    for (ptrdiff_t i = at - filter->neighbours; i <= at + filter->neighbours; i++)
        if (i >= 0 && i < known->heard &&
            fabs(known->at_m[i] - known->at_m[at]) <= filter->reach_m) {
            about[near++] = known->level_dbm[i];
            least_dbm = fmin(least_dbm, known->level_dbm[i]);
            most_dbm = fmax(most_dbm, known->level_dbm[i]);
        }
    if (near < filter->least)
        return NAN;
    if (most_dbm - least_dbm <= filter->sure_db)
        return 0.0;
    return fabs(known->level_dbm[at] - median_of(about, near));
}

/* Whether most readings of a sample stray. */
static int is_a_step(const double *stray_db, ptrdiff_t width, double most_db)
{
    ptrdiff_t told = 0, wild = 0;
    for (ptrdiff_t cell = 0; cell < width; cell++) {
        told += !isnan(stray_db[cell]);
        wild += stray_db[cell] > most_db;
    }
    return 2 * wild > told;
}

ptrdiff_t leave_out_wild(const double *distance_m, const double *rsrp_dbm, ptrdiff_t samples,
                         ptrdiff_t width, const Hampel *filter, double *left_dbm)
{
    size_t readings = (size_t)(samples * width);
    double *room = malloc((2 * readings + 2 * (size_t)samples) * sizeof *room + 1);
    if (room == NULL)
        return OUT_OF_MEMORY;
    double *stray_db = room; /* of every reading, NaN or no more than `sure` where it is good */
    Heard known = {.step_db = room + readings, .level_dbm = room + 2 * readings};
    known.at_m = known.level_dbm + samples;
    ptrdiff_t doubted = 0, wild = 0;
    for (ptrdiff_t cell = 0; cell < width; cell++) {
        hear(&known, distance_m, rsrp_dbm + cell, samples, width, filter);
        for (ptrdiff_t i = 0, at = 0; i < samples; i++) {
            double *one = stray_db + i * width + cell;
            *one = isnan(rsrp_dbm[i * width + cell]) ? NAN : stray(&known, at++, filter);
            doubted += *one > filter->sure_db;
        }
    }
    if (doubted > 0) {
        qsort(known.step_db, (size_t)known.steps, sizeof *known.step_db, rising);
        const double *middle = known.step_db + known.steps / 2;
        double median_db = known.steps == 0      ? 0.0
                           : known.steps % 2 > 0 ? middle[0]
                                                 : 0.5 * (middle[-1] + middle[0]);
        double most_db = fmax(filter->sure_db, filter->times * median_db);
        memcpy(left_dbm, rsrp_dbm, readings * sizeof *left_dbm);
        for (ptrdiff_t i = 0; i < samples; i++) {
            const double *row = stray_db + i * width;
            if ((i == 0 || i == samples - 1) && is_a_step(row, width, most_db))
                continue;
            for (ptrdiff_t cell = 0; cell < width; cell++)
                if (row[cell] > most_db) {
                    left_dbm[i * width + cell] = NAN;
                    wild++;
                }
        }
    }
    free(room);
    return wild;
}
