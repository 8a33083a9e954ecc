/* Twin of app.numerics.chosen.sum_rest. */
#include "kernels.h"

#include "approximate.h"

#include <math.h>
#include <stdlib.h>

/* e to the power of each score's distance under `top` over the temperature; 1 above it. */
FOR_EACH_MACHINE
static void weigh_scores(const float *restrict score, ptrdiff_t count, double top, double temperature,
                         float *restrict weight)
{
    float least = (float)(1.0 / temperature), most = (float)top;
    for (ptrdiff_t i = 0; i < count; i++) {
        float under = score[i] < most ? score[i] - most : 0.0f;
        weight[i] = exponential(under * least);
    }
}

/* Of one run its weight and the first of its best places; -1 where all are covered. */
typedef struct {
    double weight;
    ptrdiff_t best;
} Run;

static Run sum_run(const float *score, const float *weight, const unsigned char *covered,
                   ptrdiff_t first, ptrdiff_t end)
{
    Run run = {0.0, -1};
    for (ptrdiff_t i = first; i < end; i++) {
        if (covered[i])
            continue;
        run.weight += (double)weight[i];
        run.best = run.best < 0 || score[i] > score[run.best] ? i : run.best;
    }
    return run;
}

/* Runs that begin at 0 and further on; what they leave out in `least_m`. */
static int sum_runs(const float *score, ptrdiff_t count, const int64_t *starts, ptrdiff_t runs,
                    const float *weight, const unsigned char *covered, Run *found, double *sum)
{
    *sum = 0.0;
    if (runs > 0 && starts[0] != 0)
        return OUT_OF_BOUNDS;
    for (ptrdiff_t i = 0; i < runs; i++) {
        int64_t end = i + 1 < runs ? starts[i + 1] : count;
        if (end <= starts[i] || end > count)
            return OUT_OF_BOUNDS;
        found[i] = sum_run(score, weight, covered, starts[i], end);
        *sum += found[i].weight;
    }
    return 0;
}

static int cover(const int64_t *covered, ptrdiff_t many, unsigned char *mark, ptrdiff_t count)
{
    for (ptrdiff_t i = 0; i < many; i++) {
        if (covered[i] < 0 || covered[i] >= count)
            return OUT_OF_BOUNDS;
        mark[covered[i]] = 1;
    }
    return 0;
}

/* How many runs are kept. */
ptrdiff_t sum_rest(const float *score, ptrdiff_t count, const int64_t *starts, ptrdiff_t runs,
                   const int64_t *covered, ptrdiff_t many, const Scale *scale, double left_out,
                   int64_t *best, double *width_m)
{
    float *weight = malloc((sizeof *weight + 1) * (size_t)(count + 1));
    Run *found = malloc(sizeof *found * (size_t)(runs + 1));
    double sum = 0.0;
    ptrdiff_t kept = weight == NULL || found == NULL ? OUT_OF_MEMORY : 0;
    if (kept == 0) {
        unsigned char *mark = (unsigned char *)(weight + count + 1);
        for (ptrdiff_t i = 0; i < count; i++)
            mark[i] = 0;
        weigh_scores(score, count, scale->highest, scale->temperature, weight);
        kept = cover(covered, many, mark, count);
        if (kept == 0)
            kept = sum_runs(score, count, starts, runs, weight, mark, found, &sum);
    }
    double least_m = left_out / (double)runs * (scale->step_m * sum + scale->aligned_m);
    for (ptrdiff_t i = 0; kept >= 0 && i < runs; i++)
        if (found[i].best >= 0 && scale->step_m * found[i].weight > least_m) {
            best[kept] = found[i].best;
            width_m[kept++] = scale->step_m * found[i].weight / (double)weight[found[i].best];
        }
    free(weight);
    free(found);
    return kept;
}
