/* Twin of app.numerics.coarse._score_tape: the coarse scale, in float. */
#include "gain.h"
#include "corners.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LANES = 8, ABREAST = BLOCK / LANES, ROW = 8 }; /* blocks at a time */
typedef float Lanes __attribute__((vector_size(LANES * sizeof(float))));
typedef float LooseLanes /* the same wherever it lies */
    __attribute__((vector_size(LANES * sizeof(float)), aligned(sizeof(float)), may_alias));

/* `Said` in float; the share counts as much as hearing does. */
typedef struct {
    const float *first; /* of the cell's blocks */
    float square, level, heard, share;
} Brief;

/* What a window says of some cells: sample `i` from `first[i]` to `first[i + 1] - 1`. */
typedef struct {
    ptrdiff_t samples;
    const ptrdiff_t *behind;
    ptrdiff_t *first;
    Brief *each;
    const float **cells; /* blocks of each of them */
    ptrdiff_t count;
} Briefs;

/* A way's sums by column: score, residual and weight of one group, then those of `take_group`. */
enum { SUMS = 3 + TAKEN };

INLINE Lanes load(const float *from)
{
    return *(const LooseLanes *)from;
}

INLINE void add(float *to, Lanes lanes)
{
    *(LooseLanes *)to += lanes;
}

INLINE void keep(float *to, Lanes lanes)
{
    *(LooseLanes *)to = lanes;
}

/* What a joined sample says of all cells in a block of columns. */
INLINE void lay_score(const Tape *tape, const Factors *f, const Brief *brief, ptrdiff_t i,
                      ptrdiff_t column, Lanes score[ABREAST])
{
    Lanes hearing[ABREAST];
    for (int j = 0; j < ABREAST; j++) {
        score[j] = (float)f->outside[i] * load(tape->outside + column + j * LANES);
        hearing[j] = (Lanes){0};
    }
    for (ptrdiff_t k = f->first[i]; k < f->first[i + 1]; k++) {
        const float *at = brief[k].first + MERGED * column;
        for (int j = 0; j < ABREAST; j++, at += LANES) {
            score[j] += brief[k].square * load(at) + brief[k].level * load(at + BLOCK);
            hearing[j] += brief[k].heard * load(at + 2 * BLOCK);
            hearing[j] += brief[k].share * load(at + 3 * BLOCK);
        }
    }
    for (int j = 0; j < ABREAST; j++)
        score[j] += hearing[j];
}

/* All cells' scores, without offsets, at every column: `ahead` and `back` are the two ways' sums. */
FOR_EACH_MACHINE
static void lay_scores(const Tape *tape, const Factors *f, const Brief *brief, float *ahead,
                       float *back, Each each)
{
    for (ptrdiff_t start = 0; start < tape->columns; start += ROW * BLOCK) {
        ptrdiff_t end = start + ROW * BLOCK < tape->columns ? start + ROW * BLOCK : tape->columns;
        for (ptrdiff_t i = 0; i < f->samples; i++)
            for (ptrdiff_t column = start; column < end; column += BLOCK) {
                Lanes score[ABREAST];
                lay_score(tape, f, brief, i, column, score);
                for (int j = 0; j < ABREAST; j++) {
                    ptrdiff_t at = column + j * LANES;
                    add(ahead + at + f->behind[i], score[j]);
                    add(back + at - f->behind[i], score[j]);
                    if (each.values != NULL)
                        keep(each.values + i * each.stride + at, score[j]);
                }
            }
    }
}

/* Whether any of the cells has a level in a block; where none has, there is no residual. */
INLINE int mapped(const Briefs *own, ptrdiff_t column)
{
    Lanes any = {0};
    for (ptrdiff_t k = 0; k < own->count; k++)
        for (int j = 0; j < ABREAST; j++)
            any += load(own->cells[k] + MERGED * column + j * LANES);
    float all = 0.0f;
    for (int lane = 0; lane < LANES; lane++)
        all += any[lane];
    return all > 0.0f;
}

/* What a joined sample says of a group in a block of columns. */
INLINE void lay_residual(const Briefs *own, ptrdiff_t i, ptrdiff_t column, Lanes here[2][ABREAST])
{
    for (int channel = 0; channel < 2; channel++)
        for (int j = 0; j < ABREAST; j++)
            here[channel][j] = (Lanes){0};
    for (ptrdiff_t k = own->first[i]; k < own->first[i + 1]; k++) {
        const Brief *one = own->each + k;
        for (int j = 0; j < ABREAST; j++) {
            const float *at = one->first + MERGED * column + j * LANES;
            Lanes precision = load(at), pull = load(at + BLOCK);
            here[0][j] += one->level * precision - one->heard * pull;
            here[1][j] += one->heard * precision;
        }
    }
}

/*
 * Residuals and weights of one group at every column where it is mapped: sample by sample along
 * some blocks, for a sum that was stored a moment ago cannot be loaded at once from beside it.
 */
FOR_EACH_MACHINE
static void lay_residuals(const Tape *tape, const Briefs *own, ptrdiff_t pad,
                          float *const ways[2][SUMS], Each each, Row *touched)
{
    *touched = (Row){tape->columns, 0};
    for (ptrdiff_t start = 0; start < tape->columns; start += ROW * BLOCK) {
        ptrdiff_t end = start + ROW * BLOCK < tape->columns ? start + ROW * BLOCK : tape->columns;
        int some[ROW];
        for (ptrdiff_t column = start; column < end; column += BLOCK)
            if ((some[(column - start) / BLOCK] = mapped(own, column)))
                *touched = (Row){column < touched->first ? column : touched->first, column + BLOCK};
        for (ptrdiff_t i = 0; i < own->samples; i++) {
            if (own->first[i] == own->first[i + 1])
                continue;
            for (ptrdiff_t column = start; column < end; column += BLOCK) {
                Lanes here[2][ABREAST] = {{{0}}};
                if (some[(column - start) / BLOCK]) {
                    lay_residual(own, i, column, here);
                    for (int channel = 0; channel < 2; channel++)
                        for (int j = 0; j < ABREAST; j++) {
                            ptrdiff_t at = pad + column + j * LANES;
                            add(ways[0][1 + channel] + at + own->behind[i], here[channel][j]);
                            add(ways[1][1 + channel] + at - own->behind[i], here[channel][j]);
                        }
                } else if (each.values == NULL)
                    continue;
                for (int channel = 0; channel < 2 && each.values != NULL; channel++)
                    for (int j = 0; j < ABREAST; j++)
                        keep(each.values + (2 * i + channel) * each.stride + column + j * LANES,
                             here[channel][j]);
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

/* Rows for as many of each sample; what lies before and between them is read, and cleared. */
static Each rows_of_samples(float *room, ptrdiff_t samples, ptrdiff_t rows, ptrdiff_t columns)
{
    Each each = {room + EACH_SPARE, columns + EACH_SPARE, rows};
    for (ptrdiff_t row = 0; row <= rows * samples; row++)
        memset(each.values + row * each.stride - EACH_SPARE, 0, EACH_SPARE * sizeof(float));
    return each;
}

/* What a group's offset takes at columns. */
FOR_EACH_MACHINE
static void take_group_at(float *const way[SUMS], ptrdiff_t at, ptrdiff_t count,
                          const Likelihood *likelihood)
{
    take_group(way[1] + at, way[2] + at, count, likelihood, way[3] + at, way[4] + at, way[5] + at,
               way[6] + at, way[7] + at);
}

FOR_EACH_MACHINE
static void add_gain_at(float *const way[SUMS], ptrdiff_t at, ptrdiff_t count,
                        const Likelihood *likelihood)
{
    add_gain(way[0] + at, count, likelihood, way[3] + at, way[4] + at, way[5] + at, way[6] + at,
             way[7] + at);
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

static void make_brief(const Tape *tape, const Factors *f, Brief *brief)
{
    for (ptrdiff_t k = 0; k < f->first[f->samples]; k++) {
        const Said *one = f->said + k;
        const float *first = tape->blocks + one->cell * MERGED * tape->columns;
        float share = (float)f->hearing * (float)one->share;
        brief[k] = (Brief){first, (float)one->square, (float)one->level, (float)one->heard, share};
    }
}

/* What the window says of one group's cells, of those that the tape has. */
static void choose(const Told *told, const Tape *tape, const Factors *f, const Brief *brief,
                   ptrdiff_t group, Briefs *own)
{
    ptrdiff_t at = 0;
    for (ptrdiff_t i = 0; i < f->samples; i++) {
        own->first[i] = at;
        for (ptrdiff_t k = f->first[i]; k < f->first[i + 1]; k++)
            if (f->said[k].group == group)
                own->each[at++] = brief[k];
    }
    own->first[f->samples] = at;
    own->count = 0;
    for (ptrdiff_t cell = 0; cell < told->cells; cell++)
        if (told->group[cell] == group && told->numbers[cell] >= 0)
            own->cells[own->count++] =
                tape->blocks + told->numbers[cell] * MERGED * tape->columns;
}

/* All readings along the tape, and what offsets take of them. */
static int lay_all(const Told *told, const Tape *tape, const Factors *f, ptrdiff_t reach,
                   float *const ways[2][SUMS], const Likelihood *likelihood, const Arms *arms,
                   float *parts)
{
    ptrdiff_t said = f->first[f->samples], channels = 1 + 2 * told->groups;
    size_t pointers = (size_t)told->cells + 1, indices = (size_t)f->samples + 1;
    Brief *brief = malloc(2 * (size_t)(said + 1) * sizeof *brief + pointers * sizeof(float *) +
                          indices * sizeof(ptrdiff_t));
    if (brief == NULL)
        return OUT_OF_MEMORY;
    const float **cells = (const float **)(brief + 2 * (said + 1));
    Briefs own = {f->samples, f->behind, (ptrdiff_t *)(cells + pointers), brief + said + 1, cells, 0};
    Each each = {NULL, 0, 0};
    float *room = NULL;
    int fault = 0;
    if (arms->count > 0) {
        size_t rows = 2 * (size_t)f->samples + 1;
        room = room_for(rows * (size_t)(tape->columns + EACH_SPARE) + EACH_SPARE);
        fault = room == NULL ? OUT_OF_MEMORY : 0;
        if (fault == 0)
            each = rows_of_samples(room, f->samples, 1, tape->columns);
    }
    if (fault == 0) {
        make_brief(tape, f, brief);
        lay_scores(tape, f, brief, ways[0][0] + reach, ways[1][0] + reach, each);
        if (arms->count > 0)
            fault = lay_arms(arms, f, NULL, each, tape->columns, channels, parts);
    }
    for (ptrdiff_t group = 0; fault == 0 && group < told->groups; group++) {
        Row touched;
        choose(told, tape, f, brief, group, &own);
        if (arms->count > 0)
            each = rows_of_samples(room, f->samples, 2, tape->columns);
        lay_residuals(tape, &own, reach, ways, each, &touched);
        for (int way = 0; way < 2 && touched.end > 0; way++)
            take_group_at(ways[way], touched.first, touched.end - touched.first + 2 * reach,
                          likelihood);
        if (arms->count > 0)
            fault = lay_arms(arms, f, own.first, each, tape->columns, channels,
                             parts + (1 + 2 * group) * arms->ends);
    }
    free(brief);
    return fault;
}

/* Twin of app.numerics.coarse._score_tape: along growing columns, then against. */
int score_tape(const Told *told, const Tape *tape, const int64_t *positions, ptrdiff_t count,
               double step_m, const Likelihood *likelihood, float *score, const Arms *arms,
               float *parts)
{
    Factors f = {0};
    ptrdiff_t reach = 0, length = 0;
    float *memory = NULL, *ways[2][SUMS] = {{0}};
    int fault = aim(&f, told, tape->cells, step_m, 1, likelihood);
    if (fault == 0)
        fault = within(&f, tape, positions, count, &reach);
    if (fault == 0) {
        length = tape->columns + 2 * (reach + BLOCK);
        memory = calloc((size_t)(2 * SUMS * length), sizeof *memory);
        fault = memory == NULL ? OUT_OF_MEMORY : 0;
    }
    for (int part = 0; fault == 0 && part < 2 * SUMS; part++)
        ways[part / SUMS][part % SUMS] = memory + part * length;
    if (fault == 0)
        fault = lay_all(told, tape, &f, reach, (float *const(*)[SUMS])ways, likelihood, arms, parts);
    for (int way = 0; fault == 0 && way < 2; way++) {
        add_gain_at(ways[way], reach, tape->columns, likelihood);
        for (ptrdiff_t i = 0; i < count; i++)
            score[way * count + i] = ways[way][0][reach + positions[i]];
    }
    free(memory);
    free(f.memory);
    return fault;
}
