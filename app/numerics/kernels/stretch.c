/* Twin of app.numerics.matching._stretch: the fine scale, in double. */
#include "approximate.h"
#include "factors.h"

#include <math.h>
#include <stdlib.h>

enum { LANES = 8 };
typedef double Lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef float LooseFloats /* the same wherever it lies */
    __attribute__((vector_size(LANES * sizeof(float)), aligned(sizeof(float)), may_alias));

INLINE Lanes load(const float *from, int lanes)
{
    if (lanes == LANES)
        return __builtin_convertvector(*(const LooseFloats *)from, Lanes);
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
    for (ptrdiff_t cell = 0, k = i * f->cells; cell < f->cells; cell++, k++) {
        if (f->heard[k] == 0.0)
            continue; /* most cells are heard in few samples of a long window */
        const float *row = at + f->row[cell] * along->columns;
        Lanes precision = load(row, lanes), pull = load(row + along->columns, lanes);
        Lanes fixed = load(row + 2 * along->columns, lanes);
        Lanes logit = load(row + 3 * along->columns, lanes);
        Lanes quiet = load(row + 4 * along->columns, lanes);
        score += f->square[k] * precision + f->level[k] * pull;
        residual += f->level[k] * precision - f->heard[k] * pull;
        weight += f->heard[k] * precision;
        silence += f->heard[k] * (f->hearing * logit - 0.5 * fixed);
        silence += f->hearing * f->share[k] * quiet;
    }
    sums[0] += score + silence;
    sums[1] += residual;
    sums[2] += weight;
}

/* Sums over all samples at LANES columns; beyond the profile's ends lie its outermost columns. */
INLINE void lay_window(const Along *along, const Factors *f, ptrdiff_t column, int sign,
                       Lanes sums[3])
{
    for (ptrdiff_t i = 0; i < f->samples; i++) {
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

FOR_EACH_MACHINE
static void lay_windows(const Along *along, const Factors *f, ptrdiff_t column, ptrdiff_t count,
                        int sign, double *values, ptrdiff_t stride)
{
    for (ptrdiff_t i = 0; i < count; i += LANES) {
        Lanes sums[3] = {{0}, {0}, {0}};
        lay_window(along, f, column + i, sign, sums);
        for (int lane = 0; lane < LANES && i + lane < count; lane++)
            for (int channel = 0; channel < 3; channel++)
                values[(SCORE + channel) * stride + i + lane] = sums[channel][lane];
    }
}

static double precise_gain(double residual, double weight, const Likelihood *likelihood)
{
    double squared = 0.5 * residual * residual;
    double like = weight * likelihood->like_db2 + 1.0, any = weight * likelihood->any_db2 + 1.0;
    double first = squared * (likelihood->like_db2 / like) - 0.5 * log(like) + likelihood->like_log;
    double second = squared * (likelihood->any_db2 / any) - 0.5 * log(any) + likelihood->any_log;
    return fmax(first, second) + log1p(exp(-fabs(first - second)));
}

/* All but the chainages; rows `stride` apart. */
int score_stretch(const Told *told, const Along *along, ptrdiff_t first, ptrdiff_t count, int sign,
                  double step_m, const Likelihood *likelihood, double *values, ptrdiff_t stride)
{
    Factors f = {0};
    int fault = aim(&f, told, along, step_m, 0, likelihood);
    if (fault == 0) {
        lay_windows(along, &f, first + 1, count, sign, values, stride);
        for (ptrdiff_t i = 0; i < count; i++)
            values[SCORE * stride + i] += precise_gain(values[RESIDUAL * stride + i],
                                                       values[WEIGHT * stride + i], likelihood);
    }
    free(f.memory);
    return fault;
}
