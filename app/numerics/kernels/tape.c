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
            if (f->first[i] == f->first[i + 1] && f->outside[i] == 0.0)
                continue; /* of this carrier the sample heard nothing */
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

/* What a carrier's offset takes at every column; the rest is added to the sums of all. */
FOR_EACH_MACHINE
static void take_carriers(float *restrict score, float *restrict residual, float *restrict weight,
                          float *restrict sum_residual, float *restrict sum_weight, ptrdiff_t count,
                          const Likelihood *likelihood)
{
    float carrier_db2 = (float)likelihood->carrier_db2, temperature = (float)likelihood->temperature;
    for (ptrdiff_t i = 0; i < count; i++) {
        score[i] += take_carrier(residual + i, weight + i, carrier_db2, temperature);
        sum_residual[i] += residual[i];
        sum_weight[i] += weight[i];
        residual[i] = weight[i] = 0.0f;
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

/* Whether the window, and the tape's places, lie within what memory is made for. */
static int within(const Factors *f, const Tape *tape, const int64_t *positions, ptrdiff_t count,
                  ptrdiff_t *reach)
{
    for (ptrdiff_t i = 0; i < f->samples; i++) {
        *reach = f->behind[i] > *reach ? f->behind[i] : *reach;
        if (f->behind[i] < 0 || *reach >= tape->columns)
            return OUT_OF_BOUNDS;
    }
    for (ptrdiff_t i = 0; i < count; i++)
        if (positions[i] < *reach || positions[i] >= tape->columns - *reach)
            return OUT_OF_BOUNDS;
    return 0;
}

/* A way's sums by column: score, residual and weight of one carrier, the latter two of all. */
enum { SUMS = 5 };

/* Lays one carrier's readings along the tape, and what its offset takes of them. */
static int lay_carrier(const Tape *tape, const Factors *f, ptrdiff_t carrier, ptrdiff_t reach,
                       float *const ways[2][SUMS], ptrdiff_t length, const Likelihood *likelihood,
                       const Arms *arms, ptrdiff_t channels, float *parts)
{
    Brief *brief = malloc((size_t)(f->first[f->samples] + 1) * sizeof *brief);
    Each each = {NULL, tape->columns + EACH_SPARE};
    int fault = brief == NULL ? OUT_OF_MEMORY : 0;
    if (fault == 0 && arms->count > 0) {
        float *rows = room_for((size_t)(3 * f->samples * each.stride + 2 * EACH_SPARE));
        each.values = rows == NULL ? NULL : rows + EACH_SPARE;
        fault = rows == NULL ? OUT_OF_MEMORY : 0;
    }
    if (fault == 0) {
        float *const sums[2][3] = {{ways[0][0], ways[0][1], ways[0][2]},
                                   {ways[1][0], ways[1][1], ways[1][2]}};
        clear_spare(each, 3 * f->samples);
        make_brief(tape, f, brief);
        lay_along(tape, f, brief, reach, sums, each);
        int taken = channels > 3 || likelihood->carrier_db2 > 0.0;
        for (int way = 0; way < 2 && taken; way++)
            take_carriers(ways[way][0], ways[way][1], ways[way][2], ways[way][3], ways[way][4],
                          length, likelihood);
        if (arms->count > 0)
            fault = lay_arms(arms, f, each, tape->columns, carrier, channels, parts);
    }
    free(brief);
    return fault;
}

/* Twin of app.numerics.coarse._score_tape: along growing columns, then against. */
int score_tape(const Told *told, const Tape *tape, const int64_t *positions, ptrdiff_t count,
               double step_m, const Likelihood *likelihood, float *score, const Arms *arms,
               float *parts)
{
    ptrdiff_t reach = 0, length = 0, channels = 1 + 2 * told->carriers;
    float *memory = NULL, *ways[2][SUMS] = {{0}};
    /* Without offsets of carriers, one carrier's sums are those of all. */
    int fault = 0, left = told->carriers == 1 && !(likelihood->carrier_db2 > 0.0) ? 1 : 3;
    for (ptrdiff_t carrier = 0; fault == 0 && carrier < told->carriers; carrier++) {
        Factors f = {0};
        fault = aim(&f, told, carrier, tape->cells, step_m, 1, likelihood);
        if (fault == 0 && carrier == 0) {
            fault = within(&f, tape, positions, count, &reach);
            length = tape->columns + 2 * (reach + BLOCK);
            memory = fault == 0 ? calloc((size_t)(2 * SUMS * length), sizeof *memory) : NULL;
            fault = fault == 0 && memory == NULL ? OUT_OF_MEMORY : fault;
            for (int part = 0; fault == 0 && part < 2 * SUMS; part++)
                ways[part / SUMS][part % SUMS] = memory + part * length;
        }
        if (fault == 0)
            fault = lay_carrier(tape, &f, carrier, reach, (float *const(*)[SUMS])ways, length,
                                likelihood, arms, channels, parts);
        free(f.memory);
    }
    for (int way = 0; fault == 0 && way < 2; way++) {
        float *every = ways[way][0] + reach;
        add_gain(every, ways[way][left] + reach, ways[way][left + 1] + reach, tape->columns,
                 likelihood);
        for (ptrdiff_t i = 0; i < count; i++)
            score[way * count + i] = every[positions[i]];
    }
    free(memory);
    return fault;
}
