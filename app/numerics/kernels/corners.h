/* Windows round corners: what the halves of a window say on the arms of junctions. */
#ifndef ROADPRINT_CORNERS_H
#define ROADPRINT_CORNERS_H

#include "factors.h"

enum { EACH_SPARE = 8 }; /* floats before the first row and after every one: read, not counted */

/* Score, residual and weight of every joined sample at every column, `stride` floats a row. */
typedef struct {
    float *values;
    ptrdiff_t stride;
} Each;

/*
 * Twin of app.numerics.corners.score_arms for one carrier, the first one before the others: `parts`
 * has the score, then each carrier's residual and weight.
 */
int lay_arms(const Arms *arms, const Factors *f, Each each, ptrdiff_t columns, ptrdiff_t carrier,
             ptrdiff_t channels, float *parts);

#endif
