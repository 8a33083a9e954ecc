/* Twin of app.numerics.this_road.log_likelihoods. */
#include "levels.h"
#include "settling.h"

#include <stdlib.h>

/* The laws, a lane each: this road, much drifted, noisier, and another road. */
enum { HERE, DRIFTED, NOISIER, ANOTHER, ANY };

/* What is known of a cell's field under each law, and its sums so far. */
typedef struct {
    LooseLanes level_db, one_db, doubt_db2, squares, residual, weight;
} Strand;

/* Readings beside what the road makes of them; everything of shape (samples, cells). */
typedef struct {
    double *count, *mean_db, *precision;
    double *about; /* of each cell: the sum of counts, and of levels, later their mean */
    double *behind_m; /* of each sample, as the factor has it */
    Filter *each;  /* of each cell, under the law of any road */
    Strand *strand; /* of each cell, under the others */
    Own *own;       /* of each group */
} Work;

static int allocate(Work *work, const Told *told)
{
    size_t readings = (size_t)(told->samples * told->cells), cells = (size_t)told->cells;
    size_t samples = (size_t)told->samples;
    work->count = calloc(1, (3 * readings + 2 * cells + samples) * sizeof(double) +
                                cells * (sizeof(Filter) + sizeof(Strand)) +
                                (size_t)told->groups * sizeof(Own));
    if (work->count == NULL)
        return OUT_OF_MEMORY;
    work->mean_db = work->count + readings;
    work->precision = work->mean_db + readings;
    work->about = work->precision + readings;
    work->behind_m = work->about + 2 * cells;
    work->each = (Filter *)(work->behind_m + samples);
    work->strand = (Strand *)(work->each + cells);
    work->own = (Own *)(work->strand + cells);
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
            work->precision[place] = count * precision;
            work->about[2 * k] += count;
            work->about[2 * k + 1] += count * work->mean_db[place];
            known += count * (laws->background_log + 0.5 * log(precision));
        }
    }
    return known;
}

typedef struct {
    Lanes product, log;
} Spreads;

static void take_logs(Spreads *spreads)
{
    for (int lane = 0; lane < LANES; lane++)
        spreads->log[lane] += log(spreads->product[lane]);
    spreads->product = (Lanes){1.0, 1.0, 1.0, 1.0};
}

static void hear(Strand *one, Lanes missed_db, Lanes precision, Spreads *spreads)
{
    Lanes spread = one->doubt_db2 * precision + 1.0, innovation = precision / spread;
    Lanes gain = one->doubt_db2 * innovation;
    missed_db -= one->level_db;
    Lanes missed_one = 1.0 - one->one_db;
    one->squares += innovation * missed_db * missed_db;
    one->residual += innovation * missed_db * missed_one;
    one->weight += innovation * missed_one * missed_one;
    one->level_db += gain * missed_db;
    one->one_db += gain * missed_one;
    one->doubt_db2 *= 1.0 - gain;
    spreads->product *= spread;
    for (int lane = 0; lane < LANES; lane++)
        if (spreads->product[lane] > MOST_PRODUCT) {
            take_logs(spreads);
            break;
        }
}

/* app.numerics.elsewhere.filtered under all laws at once; the logs of their spreads' products. */
static Lanes filter_all(Work *work, const Told *told, const Laws *laws)
{
    Lanes field_db2 = {laws->drift_db2, laws->much_drift_db2, laws->drift_db2, laws->shadowing_db2};
    Lanes field_m = {laws->drift_m, laws->much_drift_m, laws->drift_m, laws->shadowing_m};
    Lanes part = {1.0, 1.0, 1.0 / laws->noise_times, 1.0};
    Spreads spreads = {{1.0, 1.0, 1.0, 1.0}, {0}};
    for (ptrdiff_t k = 0; k < told->cells; k++) {
        work->strand[k] = (Strand){.doubt_db2 = field_db2};
        work->about[2 * k + 1] /= fmax(work->about[2 * k], 1e-9);
    }
    Lanes share = {1.0, 1.0, 1.0, 1.0};
    double last_m = 0.0; /* most samples lie as far apart as the two before */
    for (ptrdiff_t row = 0; row < told->samples; row++) {
        double apart_m = row > 0 ? told->behind_m[row] - told->behind_m[row - 1] : 0.0;
        for (int lane = 0; apart_m != last_m && lane < LANES; lane++)
            share[lane] = exp(-apart_m / field_m[lane]);
        last_m = apart_m;
        Lanes grown_db2 = (1.0 - share * share) * field_db2;
        for (ptrdiff_t k = 0; k < told->cells; k++) {
            Strand *one = work->strand + k;
            one->level_db *= share;
            one->one_db *= share;
            one->doubt_db2 = share * share * one->doubt_db2 + grown_db2;
            ptrdiff_t place = row * told->cells + k;
            if (!(work->count[place] > 0.0))
                continue;
            double level_db = told->level_db[place], here_db = level_db - work->mean_db[place];
            Lanes missed_db = {here_db, here_db, here_db, level_db - work->about[2 * k + 1]};
            hear(one, missed_db, part * work->precision[place], &spreads);
        }
    }
    take_logs(&spreads);
    return spreads.log;
}

/* Log likelihoods of fields about what is expected, offsets integrated out. */
static void settle_all(Work *work, const Told *told, const Laws *laws, const Likelihood *devices,
                       double found[LANES])
{
    Lanes sum = -filter_all(work, told, laws);
    for (ptrdiff_t group = 0; group < told->groups; group++)
        work->own[group] = (Own){{0}, {0}};
    for (ptrdiff_t k = 0; k < told->cells; k++) {
        sum -= work->strand[k].squares;
        work->own[told->group[k]].residual += work->strand[k].residual;
        work->own[told->group[k]].weight += work->strand[k].weight;
    }
    Both sums = {{{0}, {0}, {0}}, {{0}, {0}, {0}}};
    Shares shares = {exp(devices->like_log), exp(devices->any_log)};
    take_groups(work->own, told->groups, devices, &sums);
    for (int lane = 0; lane < LANES; lane++) {
        double said[4];
        settle(&sums, lane, devices, shares, said);
        found[lane] = 0.5 * sum[lane] + said[0];
    }
}

int weigh_this_road(const Told *window, const Along *along, const OnRoad *at, const Laws *laws,
                    const Field *field, const Likelihood *devices, double found[5])
{
    for (ptrdiff_t k = 0; k < window->cells; k++)
        if (window->numbers[k] >= along->cells)
            return OUT_OF_BOUNDS;
    Work work;
    if (allocate(&work, window) < 0)
        return OUT_OF_MEMORY;
    Told longer = *window, *told = &longer;
    for (ptrdiff_t i = 0; i < told->samples; i++)
        work.behind_m[i] = window->behind_m[i] * at->factor;
    longer.behind_m = work.behind_m;
    double known = expect(&work, told, along, at, laws), readings = 0.0;
    int fault = isnan(known) ? OUT_OF_BOUNDS : 0;
    if (fault == 0) {
        settle_all(&work, told, laws, devices, found);
        for (int law = HERE; law < ANY; law++)
            found[law] += known;
        for (ptrdiff_t k = 0; k < told->cells; k++)
            readings += work.about[2 * k];
        found[NOISIER] -= 0.5 * log(laws->noise_times) * readings;
        for (ptrdiff_t place = 0; place < told->samples * told->cells; place++)
            work.precision[place] = work.count[place] / field->noise_db2;
        Levels levels = {told->samples, told->cells, told->behind_m, told->level_db,
                         work.precision};
        found[ANY] = any_road(&levels, field->mean_db2, field->field_db2, field->field_m,
                              work.each) +
                     field->reading_log * readings;
    }
    free(work.count);
    return fault;
}
