/* Twin of app.numerics.this_road.log_likelihoods. */
#include "levels.h"
#include "settling.h"

#include <stdlib.h>

/* Readings beside what the road makes of them; everything of shape (samples, cells). */
typedef struct {
    double *count, *mean_db, *missed_db, *precision;
    Filter *each;  /* of each cell */
    double *about; /* of each cell: twice, sums of counts and of levels */
    Own *own;      /* of each group */
} Work;

static int allocate(Work *work, const Told *told)
{
    size_t readings = (size_t)(told->samples * told->cells), cells = (size_t)told->cells;
    work->count = calloc(1, (4 * readings + 2 * cells) * sizeof(double) + cells * sizeof(Filter) +
                                (size_t)told->groups * sizeof(Own));
    if (work->count == NULL)
        return OUT_OF_MEMORY;
    work->mean_db = work->count + readings;
    work->missed_db = work->mean_db + readings;
    work->precision = work->missed_db + readings;
    work->about = work->precision + readings;
    work->each = (Filter *)(work->about + 2 * cells);
    work->own = (Own *)(work->each + cells);
    return 0;
}

/* What the road expects of a cell at two neighbouring columns, and of a place between them. */
static double expected(const float *row, ptrdiff_t columns, ptrdiff_t column, double share,
                       double *mean_db)
{
    double here = row[column], there = row[column + 1];
    if (!(here > 0.0 && there > 0.0))
        return 0.0;
    double level_db = row[columns + column] / here;
    *mean_db = level_db + share * (row[columns + column + 1] / there - level_db);
    return here + share * (there - here);
}

/* Fills in counts, means and precisions; what the noise alone adds, or NaN out of bounds. */
static double expect(Work *work, const Told *told, const Along *along, const OnRoad *at,
                     const Laws *laws)
{
    double known = 0.0;
    for (ptrdiff_t i = 0; i < told->samples; i++) {
        double behind = rint(told->behind_m[i] / at->step_m);
        if (!(fabs(behind) < MOST_COLUMNS))
            return NAN;
        ptrdiff_t column = at->low + 1 - at->sign * (ptrdiff_t)behind;
        if (column < 1 || column > along->columns - 3)
            continue;
        for (ptrdiff_t k = 0; k < told->cells; k++) {
            ptrdiff_t place = i * told->cells + k;
            double count = told->heard[place] * told->weight[i] / laws->temperature;
            if (told->numbers[k] < 0 || !(count > 0.0))
                continue;
            const float *row = along->rows + told->numbers[k] * TERMS * along->columns;
            double precision =
                expected(row, along->columns, column, at->share, work->mean_db + place);
            if (!(precision > 0.0))
                continue;
            work->count[place] = count;
            work->missed_db[place] = told->level_db[place] - work->mean_db[place];
            work->precision[place] = count * precision;
            work->about[2 * k] += count;
            work->about[2 * k + 1] += count * work->mean_db[place];
            known += count * (laws->background_log + 0.5 * log(precision));
        }
    }
    return known;
}

/* Log likelihood of a field about what is expected, offsets integrated out. */
static double settled(Work *work, const Told *told, double field_db2, double field_m,
                      const Likelihood *devices)
{
    Levels levels = {told->samples, told->cells, told->behind_m, work->missed_db, work->precision};
    double sum = -filter_levels(&levels, field_db2, field_m, work->each);
    for (ptrdiff_t group = 0; group < told->groups; group++)
        work->own[group] = (Own){{0}, {0}};
    for (ptrdiff_t k = 0; k < told->cells; k++) {
        sum -= work->each[k].squares;
        work->own[told->group[k]].residual += work->each[k].residual;
        work->own[told->group[k]].weight += work->each[k].weight;
    }
    Both sums = {{{0}, {0}, {0}}, {{0}, {0}, {0}}};
    Shares shares = {exp(devices->like_log), exp(devices->any_log)};
    double said[4];
    take_groups(work->own, told->groups, devices, &sums);
    settle(&sums, 0, devices, shares, said);
    return 0.5 * sum + said[0];
}

int weigh_this_road(const Told *told, const Along *along, const OnRoad *at, const Laws *laws,
                    const Field *field, const Likelihood *devices, double found[4])
{
    for (ptrdiff_t k = 0; k < told->cells; k++)
        if (told->numbers[k] >= along->cells)
            return OUT_OF_BOUNDS;
    Work work;
    if (allocate(&work, told) < 0)
        return OUT_OF_MEMORY;
    double known = expect(&work, told, along, at, laws);
    int fault = isnan(known) ? OUT_OF_BOUNDS : 0;
    if (fault == 0) {
        found[0] = known + settled(&work, told, laws->drift_db2, laws->drift_m, devices);
        found[1] = known + settled(&work, told, laws->much_drift_db2, laws->much_drift_m, devices);
        for (ptrdiff_t i = 0; i < told->samples; i++)
            for (ptrdiff_t k = 0; k < told->cells; k++) {
                double about_db = work.about[2 * k + 1] / fmax(work.about[2 * k], 1e-9);
                ptrdiff_t place = i * told->cells + k;
                work.missed_db[place] = told->level_db[place] - about_db;
            }
        found[2] = known + settled(&work, told, laws->shadowing_db2, laws->shadowing_m, devices);
        double readings = 0.0;
        for (ptrdiff_t k = 0; k < told->cells; k++)
            readings += work.about[2 * k];
        for (ptrdiff_t place = 0; place < told->samples * told->cells; place++)
            work.precision[place] = work.count[place] / field->noise_db2;
        Levels levels = {told->samples, told->cells, told->behind_m, told->level_db,
                         work.precision};
        found[3] = any_road(&levels, field->mean_db2, field->field_db2, field->field_m, work.each) +
                   field->reading_log * readings;
    }
    free(work.count);
    return fault;
}
