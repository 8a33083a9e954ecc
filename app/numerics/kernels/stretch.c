/* Twin of app.numerics.matching._stretch: the fine scale, in double. */
#include "approximate.h"
#include "factors.h"

#include <math.h>
#include <stdlib.h>

enum { LANES = 4 };
typedef double Lanes __attribute__((vector_size(LANES * sizeof(double))));

INLINE Lanes load(const float *from, int lanes)
{
    if (lanes == LANES)
        return (Lanes){from[0], from[1], from[2], from[3]}; /* one instruction, where x86 has it */
    Lanes some = {0};
    for (int lane = 0; lane < lanes; lane++)
        some[lane] = from[lane];
    return some;
}

/* Adds one sample's score, residual and weight at columns `column` to `column + lanes - 1`. */
INLINE void add_columns(const Along *along, const Factors *f, ptrdiff_t i, ptrdiff_t column,
                        int lanes, Lanes sums[3])
{
    const float *at = along->rows + column, *last = at + along->cells * TERMS * along->columns;
    Lanes score = f->outside[i] * load(last, lanes);
    Lanes residual = {0}, weight = {0}, silence = {0};
    for (const Said *one = f->said + f->first[i]; one < f->said + f->first[i + 1]; one++) {
        const float *row = at + one->cell * TERMS * along->columns;
        Lanes precision = load(row, lanes), pull = load(row + along->columns, lanes);
        Lanes fixed = load(row + 2 * along->columns, lanes);
        Lanes logit = load(row + 3 * along->columns, lanes);
        Lanes quiet = load(row + 4 * along->columns, lanes);
        score += one->square * precision + one->level * pull;
        residual += one->level * precision - one->heard * pull;
        weight += one->heard * precision;
        silence += one->heard * (f->hearing * logit - 0.5 * fixed);
        silence += f->hearing * one->share * quiet;
    }
    sums[0] += score + silence;
    sums[1] += residual;
    sums[2] += weight;
}

/* Adds up all samples at LANES columns; beyond the profile's ends lie its outermost columns. */
INLINE void lay_window(const Along *along, const Factors *f, ptrdiff_t column, int sign,
                       Lanes sums[3])
{
    for (ptrdiff_t i = 0; i < f->samples; i++) {
        if (f->first[i] == f->first[i + 1] && f->outside[i] == 0.0)
            continue; /* of this carrier the sample heard nothing */
        ptrdiff_t at = column - sign * f->behind[i];
        if (at >= 0 && at + LANES <= along->columns) {
            add_columns(along, f, i, at, LANES, sums);
            continue;
        }
        for (int lane = 0; lane < LANES; lane++) {
            ptrdiff_t within = at + lane < 0 ? 0 : at + lane;
            within = within < along->columns ? within : along->columns - 1;
            Lanes one[3] = {{0}, {0}, {0}};
            add_columns(along, f, i, within, 1, one);
            int alike = at + LANES <= 1 || at >= along->columns - 1;
            for (int other = lane; other < (alike ? LANES : lane + 1); other++)
                for (int channel = 0; channel < 3; channel++)
                    sums[channel][other] += one[channel][0];
            if (alike)
                break;
        }
    }
}

/* What a carrier's offset takes of its sums; the rest is added to those of all. */
INLINE void take_carrier(Lanes one[3], const Likelihood *likelihood, Lanes sums[3])
{
    Lanes inflation = 1.0 + one[2] * likelihood->carrier_db2;
    sums[0] += one[0] + 0.5 * likelihood->carrier_db2 * one[1] * one[1] / inflation;
    for (int lane = 0; lane < LANES && likelihood->carrier_db2 > 0.0; lane++)
        sums[0][lane] -= 0.5 * likelihood->temperature * log(inflation[lane]);
    sums[1] += one[1] / inflation;
    sums[2] += one[2] / inflation;
}

FOR_EACH_MACHINE
static void lay_windows(const Along *along, const Factors *f, ptrdiff_t carriers, ptrdiff_t column,
                        ptrdiff_t count, int sign, const Likelihood *likelihood, double *values,
                        ptrdiff_t stride)
{
    for (ptrdiff_t i = 0; i < count; i += LANES) {
        Lanes sums[3] = {{0}, {0}, {0}};
        for (ptrdiff_t carrier = 0; carrier < carriers; carrier++) {
            Lanes one[3] = {{0}, {0}, {0}};
            lay_window(along, f + carrier, column + i, sign, one);
            take_carrier(one, likelihood, sums);
        }
        for (int lane = 0; lane < LANES && i + lane < count; lane++)
            for (int channel = 0; channel < 3; channel++)
                values[(SCORE + channel) * stride + i + lane] = sums[channel][lane];
    }
}

static double precise_gain(double residual, double weight, const Likelihood *likelihood)
{
    double squared = 0.5 * residual * residual / likelihood->temperature;
    double like = weight * likelihood->like_db2 + 1.0, any = weight * likelihood->any_db2 + 1.0;
    double first = squared * (likelihood->like_db2 / like) - 0.5 * log(like) + likelihood->like_log;
    double second = squared * (likelihood->any_db2 / any) - 0.5 * log(any) + likelihood->any_log;
    return likelihood->temperature * (fmax(first, second) + log1p(exp(-fabs(first - second))));
}

/* Scores, residuals and weights; rows `stride` apart. */
static int score_stretch(const Laid *laid, const Likelihood *likelihood, double *values,
                         ptrdiff_t stride)
{
    ptrdiff_t count = laid->last - laid->first + 1, carriers = laid->told.carriers;
    Factors *f = calloc((size_t)carriers, sizeof *f);
    int fault = f == NULL ? OUT_OF_MEMORY : 0;
    for (ptrdiff_t carrier = 0; fault == 0 && carrier < carriers; carrier++)
        fault = aim(f + carrier, &laid->told, carrier, laid->along.cells, laid->step_m, 0,
                    likelihood);
    if (fault == 0) {
        lay_windows(&laid->along, f, carriers, laid->first + 1, count, (int)laid->sign, likelihood,
                    values, stride);
        for (ptrdiff_t i = 0; i < count; i++)
            values[SCORE * stride + i] += precise_gain(values[RESIDUAL * stride + i],
                                                       values[WEIGHT * stride + i], likelihood);
    }
    for (ptrdiff_t carrier = 0; f != NULL && carrier < carriers; carrier++)
        free(f[carrier].memory);
    free(f);
    return fault;
}

/* A place for every grid position, after `at` others. */
int lay_stretch(const Laid *laid, const Likelihood *likelihood, const Room *room, ptrdiff_t at)
{
    double *values = room->values + at;
    ptrdiff_t count = laid->last - laid->first + 1;
    for (ptrdiff_t i = 0; i < count; i++) {
        room->where[at + i] = laid->road;
        room->where[room->count + at + i] = laid->sign;
        values[CHAINAGE * room->count + i] = (double)(laid->first + i) * laid->step_m;
        values[WIDTH * room->count + i] = laid->step_m;
    }
    if (laid->last == laid->along.columns - 3)
        values[CHAINAGE * room->count + count - 1] = laid->length_m;
    return score_stretch(laid, likelihood, values, room->count);
}
