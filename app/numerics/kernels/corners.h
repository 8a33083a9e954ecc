/* Windows round corners: what the halves of a window say on the arms of junctions. */
#ifndef ROADPRINT_CORNERS_H
#define ROADPRINT_CORNERS_H

#include "factors.h"

enum { EACH_SPARE = 8 }; /* floats before the first row and after every one: read, not counted */

/* `rows` sums of every joined sample at every column, `stride` floats a row. */
typedef struct {
    float *values;
    ptrdiff_t stride, rows;
} Each;

/*
 * Twin of app.numerics.corners.score_arms for the sums of one kind: `parts` is where the first of
 * them goes of the first arm, of which every arm has `channels` rows. Samples from `first[i]` to
 * `first[i + 1] - 1` of nothing have none; NULL = all have some.
 */
int lay_arms(const Arms *arms, const Factors *f, const ptrdiff_t *first, Each each,
             ptrdiff_t columns, ptrdiff_t channels, float *parts);

#endif
