/* Twin of app.numerics.coarse._score_tape: the coarse scale, in float. */
#include "gain.h"
#include "corners.h"

#include <math.h>
#include <stdlib.h>

enum { LANES = EACH_SPARE };
typedef float Lanes __attribute__((vector_size(LANES * sizeof(float))));
typedef float LooseLanes /* the same wherever it lies */
    __attribute__((vector_size(LANES * sizeof(float)), aligned(sizeof(float)), may_alias));

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
    const float *at = along->rows + column, *last = at + along->cells * TERMS * along->columns;
    Lanes score = (float)f->outside[i] * load(last, lanes);
    Lanes residual = {0}, weight = {0}, silence = {0};
    float hearing = (float)f->hearing;
    for (ptrdiff_t cell = 0, k = i * f->cells; cell < f->cells; cell++, k++) {
        if (f->heard[k] == 0.0)
            continue; /* most cells are heard in few samples of a long window */
        const float *row = at + f->row[cell] * along->columns;
        Lanes precision = load(row, lanes), pull = load(row + along->columns, lanes);
        Lanes fixed = load(row + 2 * along->columns, lanes);
        Lanes logit = load(row + 3 * along->columns, lanes);
        Lanes quiet = load(row + 4 * along->columns, lanes);
        float square = (float)f->square[k], level = (float)f->level[k], heard = (float)f->heard[k];
        score += square * precision;
        residual += level * precision;
        weight += heard * precision;
        score += level * pull;
        residual -= heard * pull;
        silence += heard * (hearing * logit - 0.5f * fixed);
        silence += hearing * (float)f->share[k] * quiet;
    }
    sums[0] += score + silence;
    sums[1] += residual;
    sums[2] += weight;
}

INLINE void lay_columns(const Along *along, const Factors *f, ptrdiff_t column, int lanes,
                        ptrdiff_t pad, float *const sums[2][3], Each each)
{
    for (ptrdiff_t i = 0; i < f->samples; i++) {
        Lanes here[3] = {{0}, {0}, {0}};
        add_columns(along, f, i, column, lanes, here);
        for (int channel = 0; channel < 3; channel++) {
            if (each.values != NULL)
                *(LooseLanes *)(each.values + (3 * i + channel) * each.stride + column) =
                    here[channel];
            *(LooseLanes *)(sums[0][channel] + pad + column + f->behind[i]) += here[channel];
            *(LooseLanes *)(sums[1][channel] + pad + column - f->behind[i]) += here[channel];
        }
    }
}

FOR_EACH_MACHINE
static void lay_along(const Along *along, const Factors *f, ptrdiff_t pad, float *const sums[2][3],
                      Each each)
{
    ptrdiff_t column = 0;
    for (; column + LANES <= along->columns; column += LANES)
        lay_columns(along, f, column, LANES, pad, sums, each);
    if (column < along->columns)
        lay_columns(along, f, column, (int)(along->columns - column), pad, sums,
                    each);
}

FOR_EACH_MACHINE
static void add_gain(float *restrict score, const float *restrict residual,
                     const float *restrict weight, ptrdiff_t count, const Likelihood *likelihood)
{
    float like_share = (float)exp(likelihood->like_log), any_share = (float)exp(likelihood->any_log);
    for (ptrdiff_t i = 0; i < count; i++)
        score[i] += offset_gain(residual[i], weight[i], likelihood, like_share, any_share);
}

/* Twin of app.numerics.coarse._score_tape: along growing columns, then against. */
int score_tape(const Told *told, const Along *along, const int64_t *positions, ptrdiff_t count,
               double step_m, const Likelihood *likelihood, float *score, const Arms *arms,
               float *parts)
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
    Each each = {NULL, along->columns + EACH_SPARE};
    float *rows = NULL;
    if (fault == 0 && arms->count > 0) {
        size_t room = (size_t)(3 * f.samples * each.stride + 2 * EACH_SPARE);
        rows = calloc(room, sizeof *rows);
        each.values = rows == NULL ? NULL : rows + EACH_SPARE;
        fault = rows == NULL ? OUT_OF_MEMORY : 0;
    }
    if (fault == 0) {
        float *sums[2][3];
        for (int part = 0; part < 6; part++)
            sums[part / 3][part % 3] = memory + part * length;
        lay_along(along, &f, reach, (float *const(*)[3])sums, each);
        for (int way = 0; way < 2; way++) {
            float *every = sums[way][0] + reach;
            add_gain(every, sums[way][1] + reach, sums[way][2] + reach, along->columns, likelihood);
            for (ptrdiff_t i = 0; i < count; i++)
                score[way * count + i] = every[positions[i]];
        }
    }
    if (fault == 0 && arms->count > 0)
        fault = lay_arms(arms, &f, each, along->columns, parts);
    free(rows);
    free(memory);
    free(f.memory);
    return fault;
}
