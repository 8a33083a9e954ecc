/* Twins of app.numerics.corners: windows round corners at the coarse scale, in float. */
#include "corners.h"
#include "gain.h"

#include <stdlib.h>
#include <string.h>

enum { LANES = 8, MOST_ROWS = 2 }; /* lanes no more than EACH_SPARE, rows as an Each has them */
typedef float LooseLanes /* the same wherever it lies */
    __attribute__((vector_size(LANES * sizeof(float)), aligned(sizeof(float)), may_alias));

/*
 * Adds one sample's row to sums by column from the junction, from `hard` to `soft`. Sums beyond
 * `soft` are nobody's and may be spoilt, so whole vectors do.
 */
INLINE void add_row(const float *from, ptrdiff_t hard, ptrdiff_t soft, int upward, float *to)
{
    if (upward)
        for (ptrdiff_t at = hard; at <= soft; at += LANES)
            *(LooseLanes *)(to + at) += *(const LooseLanes *)(from + at);
    else
        for (ptrdiff_t at = hard - LANES + 1; at > soft - LANES; at -= LANES)
            *(LooseLanes *)(to + at) += *(const LooseLanes *)(from + at);
}

/* `sums` lead to the junction's column, for each row of a sample. */
FOR_EACH_MACHINE
static void lay_arm(const Factors *f, const ptrdiff_t *first, Each each, ptrdiff_t column, int sign,
                    int onto, ptrdiff_t ends, float *const sums[MOST_ROWS])
{
    for (ptrdiff_t i = 0; i < f->samples; i++) {
        if (first != NULL && first[i] == first[i + 1])
            continue; /* nor have its rows been filled in */
        ptrdiff_t behind = f->behind[i];
        ptrdiff_t hard = onto ? (behind > 1 ? behind : 1) : behind - 1, soft = onto ? ends : 1;
        if (onto ? hard > soft : hard < soft)
            continue;
        const float *from = each.values + each.rows * i * each.stride + column - sign * behind;
        for (int row = 0; row < each.rows; row++)
            add_row(from + row * each.stride, sign * hard, sign * soft, (sign > 0) == onto,
                    sums[row]);
    }
}

int lay_arms(const Arms *arms, const Factors *f, const ptrdiff_t *first, Each each,
             ptrdiff_t columns, ptrdiff_t channels, float *parts)
{
    ptrdiff_t reach = arms->ends;
    for (ptrdiff_t i = 0; i < f->samples; i++)
        reach = f->behind[i] > reach ? f->behind[i] : reach;
    ptrdiff_t half = reach + LANES, all = 2 * half + 1;
    float *memory = malloc(sizeof *memory * (size_t)(MOST_ROWS * all));
    int fault = memory == NULL ? OUT_OF_MEMORY : 0;
    for (ptrdiff_t arm = 0; fault == 0 && arm < arms->count; arm++) {
        int64_t column = arms->column[arm], sign = arms->sign[arm], onto = arms->onto[arm];
        int alright = column >= reach && column < columns - reach;
        if (!alright || (sign != 1 && sign != -1) || (onto != 0 && onto != 1)) {
            fault = OUT_OF_BOUNDS;
            break;
        }
        float *const sums[MOST_ROWS] = {memory + half, memory + all + half};
        memset(memory, 0, sizeof *memory * (size_t)(each.rows * all));
        lay_arm(f, first, each, column, (int)sign, (int)onto, arms->ends, sums);
        float *own = parts + arm * channels * arms->ends;
        for (int row = 0; row < each.rows; row++, own += arms->ends)
            for (ptrdiff_t end = 1; end <= arms->ends; end++)
                own[end - 1] = sums[row][sign * end];
    }
    free(memory);
    return fault;
}

/* One turn's scores; `sums` has room for what groups are added to, and for one. */
FOR_EACH_MACHINE
static void join_halves(const float *onto, const float *off, ptrdiff_t ends, ptrdiff_t channels,
                        ptrdiff_t first, ptrdiff_t last, const Likelihood *likelihood,
                        float *restrict sums, float *restrict score)
{
    float *residual = sums + TAKEN * ends, *weight = residual + ends;
    memset(sums, 0, sizeof *sums * (size_t)(TAKEN * ends));
    for (ptrdiff_t i = first - 1; i < last; i++)
        score[i] = onto[i] + off[i];
    for (ptrdiff_t channel = 1; channel < channels; channel += 2) {
        for (ptrdiff_t i = 0; i < 2 * ends; i++) /* residuals, and after them weights */
            residual[i] = onto[channel * ends + i] + off[channel * ends + i];
        take_group(residual, weight, ends, likelihood, sums, sums + ends, sums + 2 * ends,
                   sums + 3 * ends, sums + 4 * ends);
    }
    ptrdiff_t at = first - 1;
    if (last > at)
        add_gain(score + at, last - at, likelihood, sums + at, sums + ends + at,
                 sums + 2 * ends + at, sums + 3 * ends + at, sums + 4 * ends + at);
}

/* Twin of app.numerics.corners.score_turns. */
int score_turns(const float *parts, ptrdiff_t arms, ptrdiff_t channels, const Turns *turns,
                ptrdiff_t first, ptrdiff_t last, const Likelihood *likelihood, float *score)
{
    ptrdiff_t ends = turns->ends;
    for (ptrdiff_t i = 0; i < turns->count * ends; i++)
        score[i] = -INFINITY;
    float *sums = malloc(sizeof *sums * (size_t)((TAKEN + 2) * ends + 1));
    int fault = sums == NULL ? OUT_OF_MEMORY : 0;
    for (ptrdiff_t turn = 0; fault == 0 && turn < turns->count; turn++) {
        int64_t onto = turns->onto[turn], off = turns->off[turn], room = turns->room[turn];
        if (onto < 0 || onto >= arms || off < 0 || off >= arms) {
            fault = OUT_OF_BOUNDS;
            break;
        }
        join_halves(parts + channels * ends * onto, parts + channels * ends * off, ends, channels,
                    first, room < last ? room : last, likelihood, sums, score + turn * ends);
    }
    free(sums);
    return fault;
}
