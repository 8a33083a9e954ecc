/* Twins of app.numerics.alignment and of what app.numerics.matching makes of it. */
#include "kernels.h"

#include "approximate.h"

#include <math.h>
#include <stdlib.h>

enum { LANES = 8 };
typedef float Lanes __attribute__((vector_size(LANES * sizeof(float))));
typedef float LooseLanes /* the same wherever it lies */
    __attribute__((vector_size(LANES * sizeof(float)), aligned(sizeof(float)), may_alias));

/*
 * What multiplies a profile's rows: app.numerics.observation.coefficients without its zeros.
 * Channel by channel a sample needs only -1/2 h y^2, h y and h of each cell.
 */
typedef struct {
    ptrdiff_t samples, cells;
    ptrdiff_t *behind, *row;                   /* columns; first row of each cell */
    float *base, *outside;                     /* of each sample */
    float *square, *level, *heard;             /* of each sample and cell */
    float hearing;
    void *memory;
} Factors;

static int allocate(Factors *f, ptrdiff_t samples, ptrdiff_t cells)
{
    size_t indices = (size_t)(samples + cells), floats = (size_t)(samples * (2 + 3 * cells));
    f->memory = calloc(1, indices * sizeof(ptrdiff_t) + floats * sizeof(float));
    if (f->memory == NULL)
        return OUT_OF_MEMORY;
    f->behind = f->memory;
    f->row = f->behind + samples;
    f->base = (float *)(f->row + cells);
    f->outside = f->base + samples;
    f->square = f->outside + samples;
    f->level = f->square + samples * cells;
    f->heard = f->level + samples * cells;
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
        f->square[k] += (float)(-0.5 * heard * level_db * level_db);
        f->level[k] += (float)(heard * level_db);
        f->heard[k++] += (float)heard;
    }
    f->base[at] += (float)(likelihood->hearing * told->weight[i]);
    f->outside[at] += (float)(likelihood->hearing * likelihood->outside_log * all);
}

/* Twin of Query.aim; samples of one column are joined when that is wished. */
static int aim(Factors *f, const Told *told, const Along *along, double step_m, int joined,
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
    f->hearing = (float)likelihood->hearing;
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

INLINE Lanes load(const float *from, int lanes)
{
    if (lanes == LANES)
        return *(const LooseLanes *)from;
    Lanes some = {0};
    for (int lane = 0; lane < lanes; lane++)
        some[lane] = from[lane];
    return some;
}

/* Adds one sample's score, residual and weight at columns `column` to `column + lanes - 1`. */
INLINE void add_columns(const Along *along, const Factors *f, ptrdiff_t i, ptrdiff_t column,
                        int lanes, Lanes sums[3])
{
    const float *at = along->rows + column, *base = at + along->cells * TERMS * along->columns;
    Lanes score = f->base[i] * load(base, lanes);
    score += f->outside[i] * load(base + along->columns, lanes);
    Lanes residual = {0}, weight = {0}, silence = {0};
    for (ptrdiff_t cell = 0, k = i * f->cells; cell < f->cells; cell++, k++) {
        const float *row = at + f->row[cell] * along->columns;
        Lanes precision = load(row, lanes), pull = load(row + along->columns, lanes);
        Lanes fixed = load(row + 2 * along->columns, lanes);
        Lanes logit = load(row + 3 * along->columns, lanes);
        score += f->square[k] * precision;
        residual += f->level[k] * precision;
        weight += f->heard[k] * precision;
        score += f->level[k] * pull;
        residual -= f->heard[k] * pull;
        silence += f->heard[k] * (f->hearing * logit - 0.5f * fixed);
    }
    sums[0] += score + silence;
    sums[1] += residual;
    sums[2] += weight;
}

/* Twin of app.numerics.observation.offset_gain: the larger exponent taken out, one logarithm. */
INLINE float offset_gain(float residual, float weight, const Likelihood *likelihood,
                         float like_share, float any_share)
{
    float squared = 0.5f * residual * residual;
    float like_db2 = (float)likelihood->like_db2, any_db2 = (float)likelihood->any_db2;
    float like = weight * like_db2 + 1.0f, any = weight * any_db2 + 1.0f;
    float first = squared * (like_db2 / like), second = squared * (any_db2 / any);
    float apart = first - second, less = exponential(apart < 0.0f ? apart : -apart);
    float mixed = like_share / sqrtf(like) * (apart < 0.0f ? less : 1.0f) +
                  any_share / sqrtf(any) * (apart < 0.0f ? 1.0f : less);
    return (apart < 0.0f ? second : first) + logarithm(mixed);
}

INLINE void lay_columns(const Along *along, const Factors *f, ptrdiff_t column, int lanes,
                        ptrdiff_t pad, float *const sums[2][3])
{
    for (ptrdiff_t i = 0; i < f->samples; i++) {
        Lanes here[3] = {{0}, {0}, {0}};
        add_columns(along, f, i, column, lanes, here);
        for (int channel = 0; channel < 3; channel++) {
            *(LooseLanes *)(sums[0][channel] + pad + column + f->behind[i]) += here[channel];
            *(LooseLanes *)(sums[1][channel] + pad + column - f->behind[i]) += here[channel];
        }
    }
}

FOR_EACH_MACHINE
static void lay_along(const Along *along, const Factors *f, ptrdiff_t pad, float *const sums[2][3])
{
    ptrdiff_t column = 0;
    for (; column + LANES <= along->columns; column += LANES)
        lay_columns(along, f, column, LANES, pad, sums);
    if (column < along->columns)
        lay_columns(along, f, column, (int)(along->columns - column), pad, sums);
}

FOR_EACH_MACHINE
static void add_gain(float *restrict score, const float *restrict residual,
                     const float *restrict weight, ptrdiff_t count, const Likelihood *likelihood)
{
    float like_share = (float)exp(likelihood->like_log), any_share = (float)exp(likelihood->any_log);
    for (ptrdiff_t i = 0; i < count; i++)
        score[i] += offset_gain(residual[i], weight[i], likelihood, like_share, any_share);
}

/* Twin of app.numerics.matching._score_tape: along growing columns, then against. */
int score_tape(const Told *told, const Along *along, const int64_t *positions, ptrdiff_t count,
               double step_m, const Likelihood *likelihood, float *score)
{
    Factors f = {0};
    int fault = aim(&f, told, along, step_m, 1, likelihood);
    ptrdiff_t reach = 0;
    for (ptrdiff_t i = 0; fault == 0 && i < f.samples; i++) {
        reach = f.behind[i] > reach ? f.behind[i] : reach;
        fault = f.behind[i] < 0 || reach >= along->columns ? OUT_OF_BOUNDS : 0;
    }
    for (ptrdiff_t i = 0; fault == 0 && i < count; i++)
        if (positions[i] < reach || positions[i] >= along->columns - reach)
            fault = OUT_OF_BOUNDS;
    ptrdiff_t length = along->columns + 2 * (reach + LANES);
    float *memory = fault == 0 ? calloc((size_t)(6 * length), sizeof *memory) : NULL;
    if (fault == 0 && memory == NULL)
        fault = OUT_OF_MEMORY;
    if (fault == 0) {
        float *sums[2][3];
        for (int part = 0; part < 6; part++)
            sums[part / 3][part % 3] = memory + part * length;
        lay_along(along, &f, reach, (float *const(*)[3])sums);
        for (int way = 0; way < 2; way++) {
            float *every = sums[way][0] + reach;
            add_gain(every, sums[way][1] + reach, sums[way][2] + reach, along->columns, likelihood);
            for (ptrdiff_t i = 0; i < count; i++)
                score[way * count + i] = every[positions[i]];
        }
    }
    free(memory);
    free(f.memory);
    return fault;
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

static double constant_of(const Told *told, double unmapped)
{
    double missed = 0.0;
    for (ptrdiff_t cell = 0; cell < told->cells; cell++)
        for (ptrdiff_t i = 0; told->numbers[cell] < 0 && i < told->samples; i++)
            missed += told->heard[i * told->cells + cell] * told->weight[i];
    return unmapped * missed;
}

static double precise_gain(double residual, double weight, const Likelihood *likelihood)
{
    double squared = 0.5 * residual * residual;
    double like = weight * likelihood->like_db2 + 1.0, any = weight * likelihood->any_db2 + 1.0;
    double first = squared * (likelihood->like_db2 / like) - 0.5 * log(like) + likelihood->like_log;
    double second = squared * (likelihood->any_db2 / any) - 0.5 * log(any) + likelihood->any_log;
    return fmax(first, second) + log1p(exp(-fabs(first - second)));
}

/* Twin of app.numerics.matching._stretch but for the chainages; rows `stride` apart. */
int score_stretch(const Told *told, const Along *along, ptrdiff_t first, ptrdiff_t count, int sign,
                  double step_m, const Likelihood *likelihood, double *values, ptrdiff_t stride)
{
    Factors f = {0};
    int fault = aim(&f, told, along, step_m, 0, likelihood);
    if (fault == 0) {
        lay_windows(along, &f, first + 1, count, sign, values, stride);
        double constant = constant_of(told, likelihood->unmapped);
        for (ptrdiff_t i = 0; i < count; i++)
            values[SCORE * stride + i] += constant + precise_gain(values[RESIDUAL * stride + i],
                                                                  values[WEIGHT * stride + i],
                                                                  likelihood);
    }
    free(f.memory);
    return fault;
}
