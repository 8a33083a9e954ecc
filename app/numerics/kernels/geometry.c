/* Twins of what app.numerics.answer and app.numerics.posterior.radius_m make of places. */
#include "kernels.h"

#include "approximate.h"

#include <math.h>
#include <stdlib.h>

enum { RADII = 17, LANES = 24 }; /* radii are padded to whole vectors */

/* Twin of Atlas.spot: the grid position below a chainage, and the share of the way to the next. */
ptrdiff_t spot(const Atlas *atlas, int64_t road, double chainage_m, double *share)
{
    if (road < 0 || road >= atlas->roads)
        return OUT_OF_BOUNDS;
    double at = chainage_m / atlas->step_m[road];
    if (!(fabs(at) < MOST_COLUMNS))
        return OUT_OF_BOUNDS;
    int64_t start = atlas->start[road], most = atlas->size[road] - 2, low = (int64_t)at;
    if (start < 0 || start > atlas->grid || most < 0)
        return OUT_OF_BOUNDS;
    low = low < most ? low : most;
    *share = at - (double)low;
    low += start;
    return low >= 0 && low + 1 < atlas->grid ? (ptrdiff_t)low : OUT_OF_BOUNDS;
}

double between(const Atlas *atlas, int row, ptrdiff_t low, double share)
{
    const double *at = atlas->plane + row * atlas->grid + low;
    return at[0] + share * (at[1] - at[0]);
}

static int by_road(const void *left, const void *right)
{
    const Candidate *a = left, *b = right;
    if (a->road != b->road)
        return a->road < b->road ? -1 : 1;
    if (a->segment != b->segment)
        return a->segment < b->segment ? -1 : 1;
    if (a->sign != b->sign)
        return a->sign > b->sign ? -1 : 1;
    return (a->order > b->order) - (a->order < b->order);
}

static int by_mass(const void *left, const void *right)
{
    const Candidate *a = left, *b = right;
    if (a->mass != b->mass)
        return a->mass > b->mass ? -1 : 1;
    return by_road(left, right);
}

static int same(const Candidate *a, const Candidate *b)
{
    return a->road == b->road && a->segment == b->segment && a->sign == b->sign;
}

/* One a sub-segment and direction, most probable first; ties by road, segment, forward first. */
ptrdiff_t list_candidates(const Places *places, const double *mass, const Atlas *atlas,
                          Candidate *listed)
{
    const double *at_m = places->values + CHAINAGE * places->count;
    const double *score = places->values + SCORE * places->count;
    ptrdiff_t runs = 0, count = 0;
    for (ptrdiff_t i = 0; i < places->count; i++) {
        double share;
        ptrdiff_t low = spot(atlas, places->road[i], at_m[i], &share);
        if (low < 0)
            return low;
        Candidate one = {.road = places->road[i], .segment = atlas->segment[low],
                         .sign = places->sign[i] < 0 ? -1 : 1, .mass = mass[i], .score = score[i],
                         .chainage_m = at_m[i], .order = i,
                         .lon = between(atlas, LON, low, share),
                         .lat = between(atlas, LAT, low, share)};
        Candidate *last = listed + runs - 1;
        if (runs == 0 || !same(last, &one)) {
            listed[runs++] = one;
            continue;
        }
        one.mass += last->mass;
        one.order = last->order;
        if (one.score > last->score)
            *last = one;
        else
            last->mass = one.mass;
    }
    qsort(listed, (size_t)runs, sizeof *listed, by_road);
    for (ptrdiff_t i = 0; i < runs; i++) {
        if (count == 0 || !same(listed + count - 1, listed + i)) {
            listed[count++] = listed[i];
            continue;
        }
        double sum = listed[count - 1].mass + listed[i].mass;
        if (listed[i].score > listed[count - 1].score)
            listed[count - 1] = listed[i];
        listed[count - 1].mass = sum;
    }
    qsort(listed, (size_t)count, sizeof *listed, by_mass);
    return count;
}

typedef struct {
    double away_m, mass, sd_m;
    ptrdiff_t order;
} Around;

static int nearer(const void *left, const void *right)
{
    const Around *a = left, *b = right;
    if (a->away_m != b->away_m)
        return a->away_m < b->away_m ? -1 : 1;
    return (a->order > b->order) - (a->order < b->order);
}

/* Standard normal distribution function, within 3e-4 (Page 1977). */
INLINE float normal_share(float z)
{
    z = z > -8.0f ? z : -8.0f;
    z = z < 8.0f ? z : 8.0f;
    return 1.0f / (1.0f + exponential(-2.0f * z * (0.7978846f + 0.035677f * z * z)));
}

FOR_EACH_MACHINE
static void hold(const Around *restrict around, ptrdiff_t count,
                 const double *restrict radii_m, double *restrict held)
{
    for (ptrdiff_t i = 0; i < count; i++) {
        double away_m = around[i].away_m, mass = around[i].mass, per_m = 1.0 / around[i].sd_m;
        for (int r = 0; r < LANES; r++) {
            float near = normal_share((float)((radii_m[r] - away_m) * per_m));
            float far = normal_share((float)((-radii_m[r] - away_m) * per_m));
            held[r] += mass * (double)(near - far);
        }
    }
}

static double interpolate(double wanted, const double *held, const double *radii_m)
{
    if (!(wanted > held[0]))
        return radii_m[0];
    int low = RADII - 1;
    while (low > 0 && held[low] > wanted)
        low--;
    if (low == RADII - 1)
        return radii_m[low];
    double share = (wanted - held[low]) / (held[low + 1] - held[low]);
    return radii_m[low] + share * (radii_m[low + 1] - radii_m[low]);
}

/* Twin of radius_m; around is sorted by distance and not empty. */
static double radius_around(const Around *around, ptrdiff_t count, double confidence,
                            double reach_sds)
{
    double total = 0.0, covered = 0.0, sd_m = 0.0, radii_m[LANES], held[LANES] = {0};
    for (ptrdiff_t i = 0; i < count; i++) {
        total += around[i].mass;
        sd_m = around[i].sd_m > sd_m ? around[i].sd_m : sd_m;
    }
    ptrdiff_t middle = 0;
    for (; middle < count - 1; middle++) {
        covered += around[middle].mass;
        if (covered >= confidence * total)
            break;
    }
    double most_m = around[middle].away_m + reach_sds * sd_m;
    double least_m = around[middle].away_m - reach_sds * sd_m;
    least_m = least_m > 0.0 ? least_m : 0.0;
    for (int r = 0; r < LANES; r++)
        radii_m[r] = least_m + (most_m - least_m) * (r < RADII ? r / (RADII - 1.0) : 1.0);
    hold(around, count, radii_m, held);
    return interpolate(confidence * total, held, radii_m);
}

int radius(const Places *places, const double *mass, const Atlas *atlas, double x_m, double y_m,
           double confidence, double position_sd_m, double negligible, double *radius_m)
{
    const double *at_m = places->values + CHAINAGE * places->count;
    const double *width_m = places->values + WIDTH * places->count;
    Around *around = malloc(sizeof *around * (size_t)(places->count > 0 ? places->count : 1));
    if (around == NULL)
        return OUT_OF_MEMORY;
    ptrdiff_t count = 0, low = 0;
    for (ptrdiff_t i = 0; low >= 0 && i < places->count; i++) {
        double share;
        if (!(mass[i] > negligible))
            continue;
        low = spot(atlas, places->road[i], at_m[i], &share);
        if (low < 0)
            break;
        double away_m = hypot(between(atlas, X_M, low, share) - x_m,
                              between(atlas, Y_M, low, share) - y_m);
        double variance = width_m[i] * width_m[i] * (1.0 / 12.0) + position_sd_m * position_sd_m;
        around[count++] = (Around){away_m, mass[i], sqrt(variance), i};
    }
    if (low >= 0 && count > 0) {
        qsort(around, (size_t)count, sizeof *around, nearer);
        *radius_m = radius_around(around, count, confidence, 4.0);
    }
    free(around);
    return low < 0 ? (int)low : count > 0 ? 0 : OUT_OF_BOUNDS;
}
