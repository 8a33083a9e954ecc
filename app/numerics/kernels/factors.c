/* Twin of app.numerics.query.Query.aim. */
#include "factors.h"

#include <math.h>
#include <stdlib.h>

#define ON_COLUMN 1e-6 /* as in app.numerics.query */

static int allocate(Factors *f, ptrdiff_t samples, ptrdiff_t cells)
{
    size_t indices = (size_t)(2 * samples + 1), said = (size_t)(samples * cells);
    f->memory = calloc(1, said * sizeof(Said) + 2 * (size_t)samples * sizeof(double) +
                              indices * sizeof(ptrdiff_t));
    if (f->memory == NULL)
        return OUT_OF_MEMORY;
    f->said = f->memory;
    f->outside = (double *)(f->said + said);
    f->share = f->outside + samples;
    f->behind = (ptrdiff_t *)(f->share + samples);
    f->first = f->behind + samples;
    return 0;
}

/* Adds to what the last sample said; `said` has a place for each cell, heard or not. */
static void add_sample(Factors *f, const Told *told, ptrdiff_t i, const Likelihood *likelihood,
                       Said *said)
{
    double all = 0.0;
    for (ptrdiff_t cell = 0; cell < told->cells; cell++) {
        double heard = told->heard[i * told->cells + cell] * told->weight[i];
        double level_db = told->level_db[i * told->cells + cell];
        all += heard;
        if (told->numbers[cell] < 0)
            continue;
        said->square += -0.5 * heard * level_db * level_db;
        said->level += heard * level_db;
        said->share += told->share[i * told->cells + cell] * told->weight[i];
        said++->heard += heard;
    }
    f->outside[f->samples - 1] += likelihood->hearing * likelihood->outside_log * all;
}

/* Leaves out the cells that the last sample did not hear; where the next one's begin. */
static Said *close_sample(Factors *f, const Told *told, Said *said)
{
    Said *end = said;
    for (ptrdiff_t cell = 0, k = 0; cell < told->cells; cell++) {
        if (told->numbers[cell] < 0)
            continue;
        Said one = said[k];
        said[k++] = (Said){0};
        one.cell = told->numbers[cell];
        one.group = told->group[cell];
        if (one.heard != 0.0)
            *end++ = one;
    }
    f->first[f->samples] = end - f->said;
    return end;
}

/* The column that a sample lies at or after, and the share of the way to the next one; or the
 * nearest. */
static double column_behind(double columns, int nearest, double *share)
{
    double whole = rint(columns);
    if (nearest || fabs(columns - whole) < ON_COLUMN)
        return whole;
    whole = floor(columns);
    *share = columns - whole;
    return whole;
}

int aim(Factors *f, const Told *told, ptrdiff_t cells, double step_m, int joined,
        const Likelihood *likelihood)
{
    ptrdiff_t known = 0;
    for (ptrdiff_t cell = 0; cell < told->cells; cell++) {
        if (told->numbers[cell] >= cells)
            return OUT_OF_BOUNDS;
        known += told->numbers[cell] >= 0;
    }
    if (allocate(f, told->samples, known) < 0)
        return OUT_OF_MEMORY;
    f->samples = 0;
    f->hearing = likelihood->hearing;
    Said *said = f->said;
    for (ptrdiff_t i = 0; i < told->samples; i++) {
        double share = 0.0, columns = told->behind_m[i] * (1.0 / step_m);
        double behind = column_behind(columns, joined, &share);
        if (!(fabs(behind) < MOST_COLUMNS))
            return OUT_OF_BOUNDS;
        if (!joined || f->samples == 0 || f->behind[f->samples - 1] != (ptrdiff_t)behind) {
            said = f->samples == 0 ? said : close_sample(f, told, said);
            f->share[f->samples] = share;
            f->behind[f->samples++] = (ptrdiff_t)behind;
        }
        add_sample(f, told, i, likelihood, said);
    }
    if (f->samples > 0)
        close_sample(f, told, said);
    return 0;
}
