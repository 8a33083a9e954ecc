/* What multiplies a profile's rows: app.numerics.observation.coefficients without its zeros. */
#ifndef ROADPRINT_FACTORS_H
#define ROADPRINT_FACTORS_H

#include "kernels.h"

/*
 * Channel by channel a sample needs only -1/2 h y^2, h y, h and the share of each cell. The fine scale works in
 * double, so that positions are alike on every machine; the coarse one, which only chooses what
 * that looks at, in float.
 */
typedef struct {
    ptrdiff_t samples, cells;
    ptrdiff_t *behind, *row;          /* columns; first row of each cell */
    double *outside;                          /* of each sample */
    double *square, *level, *heard, *share;   /* of each sample and cell */
    double hearing;
    void *memory; /* all of it: to be freed */
} Factors;

/* Twin of Query.aim; samples of one column are joined when that is wished. */
int aim(Factors *f, const Told *told, const Along *along, double step_m, int joined,
        const Likelihood *likelihood);

#endif
