/* Twins of app.numerics.posterior.kept_by_mass and masses, and of app.numerics.answer's peak. */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>

typedef struct {
    double weight;
    ptrdiff_t index;
} Weighed;

static int heavier(const void *left, const void *right)
{
    const Weighed *a = left, *b = right;
    if (a->weight != b->weight)
        return a->weight > b->weight ? -1 : 1;
    return (a->index > b->index) - (a->index < b->index);
}

static int earlier(const void *left, const void *right)
{
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return (a > b) - (a < b);
}

/* Equal weights in the order of their indices. */
ptrdiff_t keep_by_mass(const float *score, ptrdiff_t count, double temperature, double left_out,
                       ptrdiff_t most, int64_t *kept)
{
    Weighed *likely = malloc(sizeof *likely * (size_t)(count > 0 ? count : 1));
    if (likely == NULL)
        return OUT_OF_MEMORY;
    float top = -INFINITY;
    for (ptrdiff_t i = 0; i < count; i++)
        top = score[i] > top ? score[i] : top;
    /* What lies under the cut is a billionth of the total together: not worth its exponentials. */
    double cut = top + temperature * log(1e-9 / (double)count), total = 0.0, sum = 0.0;
    ptrdiff_t found = 0, enough = 0;
    for (ptrdiff_t i = 0; i < count; i++)
        if (score[i] >= cut) {
            double weight = exp(((double)score[i] - top) / temperature);
            total += weight;
            likely[found++] = (Weighed){weight, i};
        }
    /* Places under the floor hold less than half of left_out together: sort the others only. */
    double floor_weight = 0.5 * left_out * total / (double)count;
    ptrdiff_t above = 0;
    for (ptrdiff_t i = 0; i < found; i++)
        if (likely[i].weight >= floor_weight)
            likely[above++] = likely[i];
    qsort(likely, (size_t)above, sizeof *likely, heavier);
    while (enough < above && enough < most) {
        sum += likely[enough].weight;
        kept[enough] = likely[enough].index;
        enough++;
        if (sum >= (1.0 - left_out) * total)
            break;
    }
    free(likely);
    qsort(kept, (size_t)enough, sizeof *kept, earlier);
    return enough;
}

void share_mass(const Places *places, double temperature, double *mass)
{
    const double *score = places->values + SCORE * places->count;
    const double *width_m = places->values + WIDTH * places->count;
    double top = -INFINITY, total = 0.0;
    for (ptrdiff_t i = 0; i < places->count; i++)
        top = score[i] > top ? score[i] : top;
    for (ptrdiff_t i = 0; i < places->count; i++) {
        mass[i] = exp((score[i] - top) / temperature) * width_m[i];
        total += mass[i];
    }
    for (ptrdiff_t i = 0; i < places->count; i++)
        mass[i] /= total;
}

/* The most probable road, its highest peak, and the mean about that; the first of equals. */
int find_summit(const Places *places, const double *mass, ptrdiff_t roads, double near_m, double foot,
                ptrdiff_t *road, double *road_mass, ptrdiff_t *peak, double *chainage_m)
{
    const double *at_m = places->values + CHAINAGE * places->count;
    const double *score = places->values + SCORE * places->count;
    double *on_road = calloc((size_t)(roads > 0 ? roads : 1), sizeof *on_road);
    if (on_road == NULL)
        return OUT_OF_MEMORY;
    int fault = places->count > 0 ? 0 : OUT_OF_BOUNDS;
    for (ptrdiff_t i = 0; i < places->count; i++)
        if (places->road[i] >= 0 && places->road[i] < roads)
            on_road[places->road[i]] += mass[i];
        else
            fault = OUT_OF_BOUNDS;
    *road = *peak = 0;
    for (ptrdiff_t i = 1; fault == 0 && i < roads; i++)
        *road = on_road[i] > on_road[*road] ? i : *road;
    *road_mass = fault == 0 ? on_road[*road] : 0.0;
    free(on_road);
    if (fault != 0)
        return fault;
    double highest = -INFINITY, sum = 0.0, moment = 0.0;
    for (ptrdiff_t i = 0; i < places->count; i++)
        if (places->road[i] == *road && score[i] > highest) {
            highest = score[i];
            *peak = i;
        }
    const double *width_m = places->values + WIDTH * places->count;
    foot *= mass[*peak] / width_m[*peak];
    for (ptrdiff_t i = 0; i < places->count; i++)
        if (fabs(at_m[i] - at_m[*peak]) <= near_m && places->road[i] == places->road[*peak] &&
            places->sign[i] == places->sign[*peak]) {
            double counted = fmax(mass[i] - foot * width_m[i], 0.0);
            sum += counted;
            moment += counted * at_m[i];
        }
    *chainage_m = moment / sum;
    return 0;
}
