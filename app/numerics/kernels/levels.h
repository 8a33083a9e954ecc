/* Levels of cells along a road as Gauss-Markov fields: app.numerics.elsewhere.filtered. */
#ifndef ROADPRINT_LEVELS_H
#define ROADPRINT_LEVELS_H

#include <stddef.h>

/* What is known of a cell's field, and its sums so far. */
typedef struct {
    double level_db, one_db, doubt_db2, squares, residual, weight;
} Filter;

/* Readings, newest first, and the precision of each, 0 where there is none: (samples, cells). */
typedef struct {
    ptrdiff_t samples, cells;
    const double *behind_m, *level_db, *precision;
} Levels;

/* Fills in a filter of each cell; the log of the product of all spreads. */
double filter_levels(const Levels *levels, double field_db2, double field_m, Filter *each);

/* What any road makes of readings, but for READING_LOG each. */
double any_road(const Levels *levels, double mean_db2, double field_db2, double field_m,
                Filter *each);

#endif
