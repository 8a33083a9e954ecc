/* What multiplies a profile's rows: app.numerics.observation.coefficients without its zeros. */
#ifndef ROADPRINT_FACTORS_H
#define ROADPRINT_FACTORS_H

#include "kernels.h"

/* What one sample says of one cell that it heard: -1/2 h y^2, h y, h and the cell's share. */
typedef struct {
    ptrdiff_t cell, group; /* its number in the profile, and of its group */
    double square, level, heard, share;
} Said;

/*
 * All samples of a window, and beside them what they heard: of a long window's cells each sample
 * hears few. The fine scale works in double, so that positions are alike on every machine; the
 * coarse one, which only chooses what that looks at, in float.
 */
typedef struct {
    ptrdiff_t samples;
    ptrdiff_t *behind; /* columns, of each sample */
    ptrdiff_t *first;  /* of what each sample said; one more, the end, follows the last */
    double *outside;   /* of each sample */
    double *share;     /* of the way to the next column behind, of each sample */
    Said *said;
    double hearing;
    void *memory; /* all of it: to be freed */
} Factors;

/* Twin of Query.aim; samples are taken to the nearest column, and those of one are joined, when that
 * is wished. */
int aim(Factors *f, const Told *told, ptrdiff_t cells, double step_m, int joined,
        const Likelihood *likelihood);

#endif
