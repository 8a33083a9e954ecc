/* Twin of app.numerics.coarse._score_tape: the coarse scale, in float. */
#include "gain.h"
#include "corners.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LANES = 8, ABREAST = BLOCK / LANES };
typedef float Lanes __attribute__((vector_size(LANES * sizeof(float))));
typedef float LooseLanes /* the same wherever it lies */
    __attribute__((vector_size(LANES * sizeof(float)), aligned(sizeof(float)), may_alias));

/* `Said` in float; the share counts as much as hearing does. */
typedef struct {
    const float *first; /* of the cell's blocks */
    float square, level, heard, share;
} Brief;

INLINE Lanes load(const float *from)
{
    return *(const LooseLanes *)from;
}

/* One sample's score, residual and weight at the columns of a block. */
INLINE void lay_sample(const Factors *f, const Brief *brief, ptrdiff_t i, const float *outside,
                       ptrdiff_t column, Lanes here[3][ABREAST])
{
    Lanes score[ABREAST], residual[ABREAST], weight[ABREAST], hearing[ABREAST];
    for (int j = 0; j < ABREAST; j++) {
        score[j] = (float)f->outside[i] * load(outside + column + j * LANES);
        residual[j] = weight[j] = hearing[j] = (Lanes){0};
    }
    for (ptrdiff_t k = f->first[i]; k < f->first[i + 1]; k++) {
        const float *at = brief[k].first + MERGED * column;
        for (int j = 0; j < ABREAST; j++, at += LANES) {
            Lanes precision = load(at), pull = load(at + BLOCK);
            score[j] += brief[k].square * precision + brief[k].level * pull;
            residual[j] += brief[k].level * precision - brief[k].heard * pull;
            weight[j] += brief[k].heard * precision;
            hearing[j] += brief[k].heard * load(at + 2 * BLOCK);
            hearing[j] += brief[k].share * load(at + 3 * BLOCK);
        }
    }
    for (int j = 0; j < ABREAST; j++) {
        here[0][j] = score[j] + hearing[j];
        here[1][j] = residual[j];
        here[2][j] = weight[j];
    }
}

FOR_EACH_MACHINE
static void lay_along(const Tape *tape, const Factors *f, const Brief *brief, ptrdiff_t pad,
                      float *const sums[2][3], Each each)
{
    for (ptrdiff_t column = 0; column < tape->columns; column += BLOCK)
        for (ptrdiff_t i = 0; i < f->samples; i++) {
            Lanes here[3][ABREAST];
            lay_sample(f, brief, i, tape->outside, column, here);
            for (int channel = 0; channel < 3; channel++) {
                float *ahead = sums[0][channel] + pad + column + f->behind[i];
                float *back = sums[1][channel] + pad + column - f->behind[i];
                for (int j = 0; j < ABREAST; j++) {
                    Lanes one = here[channel][j];
                    *(LooseLanes *)(ahead + j * LANES) += one;
                    *(LooseLanes *)(back + j * LANES) += one;
                    if (each.values != NULL)
                        *(LooseLanes *)(each.values + (3 * i + channel) * each.stride + column +
                                        j * LANES) = one;
                }
            }
        }
}

/*
 * Room for all that samples say along a tape. It is kept from call to call, for fresh memory costs
 * as much as filling it; the caller holds the interpreter's lock.
 */
static float *room_for(size_t wanted)
{
    static float *room = NULL;
    static size_t size = 0;
    if (wanted > size) {
        free(room);
        room = malloc(wanted * sizeof *room);
        size = room == NULL ? 0 : wanted;
    }
    return room;
}

static void clear_spare(Each each, ptrdiff_t rows)
{
    for (ptrdiff_t row = 0; each.values != NULL && row <= rows; row++)
        memset(each.values + row * each.stride - EACH_SPARE, 0, EACH_SPARE * sizeof(float));
}

static void make_brief(const Tape *tape, const Factors *f, Brief *brief)
{
    for (ptrdiff_t k = 0; k < f->first[f->samples]; k++) {
        const Said *one = f->said + k;
        const float *first = tape->blocks + one->cell * MERGED * tape->columns;
        float share = (float)f->hearing * (float)one->share;
        brief[k] = (Brief){first, (float)one->square, (float)one->level, (float)one->heard, share};
    }
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
int score_tape(const Told *told, const Tape *tape, const int64_t *positions, ptrdiff_t count,
               double step_m, const Likelihood *likelihood, float *score, const Arms *arms,
               float *parts)
{
    Factors f = {0};
    int fault = aim(&f, told, tape->cells, step_m, 1, likelihood);
    ptrdiff_t reach = 0;
    for (ptrdiff_t i = 0; fault == 0 && i < f.samples; i++) {
        reach = f.behind[i] > reach ? f.behind[i] : reach;
        fault = f.behind[i] < 0 || reach >= tape->columns ? OUT_OF_BOUNDS : 0;
    }
    for (ptrdiff_t i = 0; fault == 0 && i < count; i++)
        if (positions[i] < reach || positions[i] >= tape->columns - reach)
            fault = OUT_OF_BOUNDS;
    ptrdiff_t length = tape->columns + 2 * (reach + BLOCK);
    size_t said = fault == 0 ? (size_t)f.first[f.samples] : 0;
    float *memory = fault == 0 ? calloc((size_t)(6 * length), sizeof *memory) : NULL;
    Brief *brief = malloc((said + 1) * sizeof *brief);
    if (fault == 0 && (memory == NULL || brief == NULL))
        fault = OUT_OF_MEMORY;
    Each each = {NULL, tape->columns + EACH_SPARE};
    if (fault == 0 && arms->count > 0) {
        float *rows = room_for((size_t)(3 * f.samples * each.stride + 2 * EACH_SPARE));
        each.values = rows == NULL ? NULL : rows + EACH_SPARE;
        fault = rows == NULL ? OUT_OF_MEMORY : 0;
    }
    if (fault == 0) {
        float *sums[2][3];
        for (int part = 0; part < 6; part++)
            sums[part / 3][part % 3] = memory + part * length;
        clear_spare(each, 3 * f.samples);
        make_brief(tape, &f, brief);
        lay_along(tape, &f, brief, reach, (float *const(*)[3])sums, each);
        for (int way = 0; way < 2; way++) {
            float *every = sums[way][0] + reach;
            add_gain(every, sums[way][1] + reach, sums[way][2] + reach, tape->columns, likelihood);
            for (ptrdiff_t i = 0; i < count; i++)
                score[way * count + i] = every[positions[i]];
        }
    }
    if (fault == 0 && arms->count > 0)
        fault = lay_arms(arms, &f, each, tape->columns, parts);
    free(brief);
    free(memory);
    free(f.memory);
    return fault;
}
