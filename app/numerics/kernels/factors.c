/* Twin of app.numerics.query.Query.aim. */
#include "factors.h"

#include <math.h>
#include <stdlib.h>

static int allocate(Factors *f, ptrdiff_t samples, ptrdiff_t cells)
{
    size_t indices = (size_t)(samples + cells), numbers = (size_t)(samples * (1 + 4 * cells));
    f->memory = calloc(1, indices * sizeof(ptrdiff_t) + numbers * sizeof(double));
    if (f->memory == NULL)
        return OUT_OF_MEMORY;
    f->outside = f->memory;
    f->square = f->outside + samples;
    f->level = f->square + samples * cells;
    f->heard = f->level + samples * cells;
    f->share = f->heard + samples * cells;
    f->behind = (ptrdiff_t *)(f->share + samples * cells);
    f->row = f->behind + samples;
    return 0;
}

static void add_sample(Factors *f, const Told *told, ptrdiff_t i, const Likelihood *likelihood)
{
    ptrdiff_t at = f->samples - 1, k = at * f->cells;
    double all = 0.0;
    for (ptrdiff_t cell = 0; cell < told->cells; cell++) {
        double heard = told->heard[i * told->cells + cell] * told->weight[i];
        double level_db = told->level_db[i * told->cells + cell];
        all += heard;
        if (told->numbers[cell] < 0)
            continue;
        f->square[k] += -0.5 * heard * level_db * level_db;
        f->level[k] += heard * level_db;
        f->share[k] += told->share[i * told->cells + cell] * told->weight[i];
        f->heard[k++] += heard;
    }
    f->outside[at] += likelihood->hearing * likelihood->outside_log * all;
}

int aim(Factors *f, const Told *told, const Along *along, double step_m, int joined,
        const Likelihood *likelihood)
{
    ptrdiff_t cells = 0;
    for (ptrdiff_t cell = 0; cell < told->cells; cell++) {
        if (told->numbers[cell] >= along->cells)
            return OUT_OF_BOUNDS;
        cells += told->numbers[cell] >= 0;
    }
    if (allocate(f, told->samples, cells) < 0)
        return OUT_OF_MEMORY;
    f->samples = 0;
    f->cells = 0;
    f->hearing = likelihood->hearing;
    for (ptrdiff_t cell = 0; cell < told->cells; cell++)
        if (told->numbers[cell] >= 0)
            f->row[f->cells++] = told->numbers[cell] * TERMS;
    for (ptrdiff_t i = 0; i < told->samples; i++) {
        double behind = rint(told->behind_m[i] * (1.0 / step_m));
        if (!(fabs(behind) < MOST_COLUMNS))
            return OUT_OF_BOUNDS;
        if (!joined || f->samples == 0 || f->behind[f->samples - 1] != (ptrdiff_t)behind)
            f->behind[f->samples++] = (ptrdiff_t)behind;
        add_sample(f, told, i, likelihood);
    }
    return 0;
}
