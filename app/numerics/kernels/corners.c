/* Twins of app.numerics.corners: windows round corners at the coarse scale, in float. */
#include "corners.h"
#include "gain.h"

#include <stdlib.h>
#include <string.h>

enum { LANES = 8 }; /* no more than EACH_SPARE */
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

/* `sums` lead to the junction's column: of score, residual and weight. */
FOR_EACH_MACHINE
static void lay_arm(const Factors *f, Each each, ptrdiff_t column, int sign, int onto,
                    ptrdiff_t ends, float *const sums[3])
{
    for (ptrdiff_t i = 0; i < f->samples; i++) {
        if (f->first[i] == f->first[i + 1] && f->outside[i] == 0.0)
            continue; /* nor has its row been filled in */
        ptrdiff_t behind = f->behind[i];
        ptrdiff_t hard = onto ? (behind > 1 ? behind : 1) : behind - 1, soft = onto ? ends : 1;
        if (onto ? hard > soft : hard < soft)
            continue;
        const float *from = each.values + 3 * i * each.stride + column - sign * behind;
        for (int channel = 0; channel < 3; channel++)
            add_row(from + channel * each.stride, sign * hard, sign * soft, (sign > 0) == onto,
                    sums[channel]);
    }
}

int lay_arms(const Arms *arms, const Factors *f, Each each, ptrdiff_t columns, ptrdiff_t carrier,
             ptrdiff_t channels, float *parts)
{
    ptrdiff_t reach = arms->ends;
    for (ptrdiff_t i = 0; i < f->samples; i++)
        reach = f->behind[i] > reach ? f->behind[i] : reach;
    ptrdiff_t half = reach + LANES;
    float *memory = malloc(sizeof *memory * (size_t)(3 * (2 * half + 1)));
    int fault = memory == NULL ? OUT_OF_MEMORY : 0;
    for (ptrdiff_t arm = 0; fault == 0 && arm < arms->count; arm++) {
        int64_t column = arms->column[arm], sign = arms->sign[arm], onto = arms->onto[arm];
        int alright = column >= reach && column < columns - reach;
        if (!alright || (sign != 1 && sign != -1) || (onto != 0 && onto != 1)) {
            fault = OUT_OF_BOUNDS;
            break;
        }
        float *const sums[3] = {memory + half, memory + 3 * half + 1, memory + 5 * half + 2};
        memset(memory, 0, sizeof *memory * (size_t)(3 * (2 * half + 1)));
        lay_arm(f, each, column, (int)sign, (int)onto, arms->ends, sums);
        float *score = parts + arm * channels * arms->ends;
        float *own = score + (1 + 2 * carrier) * arms->ends;
        for (ptrdiff_t end = 1; end <= arms->ends; end++) {
            score[end - 1] = sums[0][sign * end] + (carrier > 0 ? score[end - 1] : 0.0f);
            own[end - 1] = sums[1][sign * end];
            own[arms->ends + end - 1] = sums[2][sign * end];
        }
    }
    free(memory);
    return fault;
}

/* One turn's scores; `left` has room for the residuals and the weights that carriers leave. */
FOR_EACH_MACHINE
static void join_halves(const float *onto, const float *off, ptrdiff_t ends, ptrdiff_t channels,
                        ptrdiff_t first, ptrdiff_t last, const Likelihood *likelihood,
                        float *restrict left, float *restrict score)
{
    float like_share = (float)exp(likelihood->like_log), any_share = (float)exp(likelihood->any_log);
    float carrier_db2 = (float)likelihood->carrier_db2, temperature = (float)likelihood->temperature;
    memset(left, 0, sizeof *left * (size_t)(2 * ends));
    for (ptrdiff_t i = first - 1; i < last; i++)
        score[i] = onto[i] + off[i];
    for (ptrdiff_t channel = 1; channel < channels; channel += 2) {
        const float *residual = onto + channel * ends, *from_residual = off + channel * ends;
        const float *weight = residual + ends, *from_weight = from_residual + ends;
        for (ptrdiff_t i = first - 1; i < last; i++) {
            float both_residual = residual[i] + from_residual[i];
            float both_weight = weight[i] + from_weight[i];
            score[i] += take_carrier(&both_residual, &both_weight, carrier_db2, temperature);
            left[i] += both_residual;
            left[ends + i] += both_weight;
        }
    }
    for (ptrdiff_t i = first - 1; i < last; i++)
        score[i] += offset_gain(left[i], left[ends + i], likelihood, like_share, any_share);
}

/* Twin of app.numerics.corners.score_turns. */
int score_turns(const float *parts, ptrdiff_t arms, ptrdiff_t channels, const Turns *turns,
                ptrdiff_t first, ptrdiff_t last, const Likelihood *likelihood, float *score)
{
    ptrdiff_t ends = turns->ends;
    for (ptrdiff_t i = 0; i < turns->count * ends; i++)
        score[i] = -INFINITY;
    float *left = malloc(sizeof *left * (size_t)(2 * ends + 1));
    int fault = left == NULL ? OUT_OF_MEMORY : 0;
    for (ptrdiff_t turn = 0; fault == 0 && turn < turns->count; turn++) {
        int64_t onto = turns->onto[turn], off = turns->off[turn], room = turns->room[turn];
        if (onto < 0 || onto >= arms || off < 0 || off >= arms) {
            fault = OUT_OF_BOUNDS;
            break;
        }
        join_halves(parts + channels * ends * onto, parts + channels * ends * off, ends, channels,
                    first, room < last ? room : last, likelihood, left, score + turn * ends);
    }
    free(left);
    return fault;
}
