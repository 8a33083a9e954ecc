/* Twins of app.numerics.posterior.kept_by_mass and masses, and of app.numerics.answer's peak. */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { DIGIT_BITS = 11, DIGITS = 3, BUCKETS = 1 << DIGIT_BITS, FEW = 96 };

typedef struct {
    uint32_t key;
    ptrdiff_t index;
} Keyed;

/* Larger floats get smaller keys: both signs, no NaN. */
static uint32_t key_of(float score)
{
    uint32_t bits;
    memcpy(&bits, &score, sizeof bits);
    return bits & 0x80000000u ? bits : ~bits & 0x7fffffffu;
}

static void insert_by_key(Keyed *each, ptrdiff_t count)
{
    for (ptrdiff_t i = 1; i < count; i++) {
        Keyed one = each[i];
        ptrdiff_t at = i;
        for (; at > 0 && each[at - 1].key > one.key; at--)
            each[at] = each[at - 1];
        each[at] = one;
    }
}

/* Sorts by key, equal keys as they stood; needs room for a copy; where the sorted ones are. */
static const Keyed *sort_by_key(Keyed *each, Keyed *copy, ptrdiff_t count)
{
    if (count <= FEW) {
        insert_by_key(each, count);
        return each;
    }
    for (int digit = 0; digit < DIGITS; digit++) {
        ptrdiff_t starts[BUCKETS + 1] = {0};
        for (ptrdiff_t i = 0; i < count; i++)
            starts[((each[i].key >> (digit * DIGIT_BITS)) & (BUCKETS - 1)) + 1]++;
        for (int bucket = 0; bucket < BUCKETS; bucket++)
            starts[bucket + 1] += starts[bucket];
        for (ptrdiff_t i = 0; i < count; i++)
            copy[starts[(each[i].key >> (digit * DIGIT_BITS)) & (BUCKETS - 1)]++] = each[i];
        Keyed *sorted = copy;
        copy = each;
        each = sorted;
    }
    return each;
}

static int earlier(const void *left, const void *right)
{
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return (a > b) - (a < b);
}

/* Equal scores in the order of their indices. */
ptrdiff_t keep_by_mass(const float *score, ptrdiff_t count, double temperature, double left_out,
                       ptrdiff_t most, int64_t *kept)
{
    Keyed *likely = malloc(2 * sizeof *likely * (size_t)(count > 0 ? count : 1));
    if (likely == NULL)
        return OUT_OF_MEMORY;
    float top = -INFINITY;
    for (ptrdiff_t i = 0; i < count; i++)
        top = score[i] > top ? score[i] : top;
    /* What lies under the cut is a billionth of the total together: not worth its exponentials. */
    double cut = top + temperature * log(1e-9 / (double)count), total = 0.0, sum = 0.0;
    ptrdiff_t found = 0, above = 0, enough = 0;
    for (ptrdiff_t i = 0; i < count; i++)
        if (score[i] >= cut) {
            total += exp(((double)score[i] - top) / temperature);
            likely[found++] = (Keyed){key_of(score[i]), i};
        }
    /* Places under the floor hold less than half of left_out together: sort the others only. */
    double low = top + temperature * log(0.5 * left_out * total / (double)count);
    for (ptrdiff_t i = 0; i < found; i++)
        if (score[likely[i].index] >= low)
            likely[above++] = likely[i];
    const Keyed *sorted = sort_by_key(likely, likely + count, above);
    while (enough < above && enough < most) {
        sum += exp(((double)score[sorted[enough].index] - top) / temperature);
        kept[enough] = sorted[enough].index;
        enough++;
        if (sum >= (1.0 - left_out) * total)
            break;
    }
    free(likely);
    if (enough > 1)
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
