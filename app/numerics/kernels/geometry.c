/* Twins of app.numerics.index.Atlas.spot and app.numerics.posterior.radius_m. */
#include "kernels.h"

#include "approximate.h"

#include <math.h>
#include <stdlib.h>

#define SURE_SDS 8.0f /* farther is certain to the last bit */
enum { FEW = 32, RADII = 17, LANES = 24 }; /* radii are padded to whole vectors */

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

typedef struct {
    double away_m, mass, sd_m;
} Around;

static int nearer(const void *left, const void *right)
{
    const Around *a = left, *b = right;
    return (a->away_m > b->away_m) - (a->away_m < b->away_m);
}

/* The distance within which `wanted` of the mass lies; orders no more places than it must. */
static double middle_m(Around *around, ptrdiff_t count, double wanted)
{
    while (count > FEW) {
        double least = INFINITY, most = -INFINITY, near = 0.0;
        for (ptrdiff_t i = 0; i < count; i++) {
            least = fmin(least, around[i].away_m);
            most = fmax(most, around[i].away_m);
        }
        double half = least + 0.5 * (most - least);
        if (!(half < most))
            return most; /* all at one distance */
        ptrdiff_t first = 0, end = count; /* nearer ones to the front */
        while (first < end) {
            if (around[first].away_m <= half) {
                near += around[first++].mass;
                continue;
            }
            Around one = around[first];
            around[first] = around[--end];
            around[end] = one;
        }
        if (near >= wanted) {
            count = first;
        } else {
            around += first;
            count -= first;
            wanted -= near;
        }
    }
    qsort(around, (size_t)count, sizeof *around, nearer);
    double covered = around[0].mass;
    ptrdiff_t at = 0;
    while (at < count - 1 && covered < wanted)
        covered += around[++at].mass;
    return around[at].away_m;
}

/* Standard normal distribution function, within 3e-4 (Page 1977). */
INLINE float normal_share(float z)
{
    z = z > -SURE_SDS ? z : -SURE_SDS;
    z = z < SURE_SDS ? z : SURE_SDS;
    return 1.0f / (1.0f + exponential(-2.0f * z * (0.7978846f + 0.035677f * z * z)));
}

FOR_EACH_MACHINE
static void hold(const Around *restrict around, ptrdiff_t count,
                 const double *restrict radii_m, double *restrict held)
{
    double within = 0.0; /* all of them */
    for (ptrdiff_t i = 0; i < count; i++) {
        double away_m = around[i].away_m, mass = around[i].mass, per_m = 1.0 / around[i].sd_m;
        double margin_m = SURE_SDS * around[i].sd_m;
        if (away_m - margin_m > radii_m[LANES - 1])
            continue; /* beyond all of them */
        if (away_m + margin_m < radii_m[0]) {
            within += mass;
            continue;
        }
        for (int r = 0; r < LANES; r++) {
            float near = normal_share((float)((radii_m[r] - away_m) * per_m));
            float far = normal_share((float)((-radii_m[r] - away_m) * per_m));
            held[r] += mass * (double)(near - far);
        }
    }
    for (int r = 0; r < LANES; r++)
        held[r] += within;
}

static double held_at(const Around *around, ptrdiff_t count, double radius_m)
{
    double held = 0.0;
    for (ptrdiff_t i = 0; i < count; i++) {
        double per_m = 1.0 / around[i].sd_m;
        float near = normal_share((float)((radius_m - around[i].away_m) * per_m));
        float far = normal_share((float)((-radius_m - around[i].away_m) * per_m));
        held += around[i].mass * (double)(near - far);
    }
    return held;
}

static double straight(double wanted, double low, double high, double low_m, double high_m)
{
    return high > low ? low_m + (wanted - low) / (high - low) * (high_m - low_m) : low_m;
}

/* Straight between the radii about it, then between what it holds there and the nearer of them. */
static double interpolate(const Around *around, ptrdiff_t count, double wanted, const double *held,
                          const double *radii_m)
{
    if (!(wanted > held[0]))
        return radii_m[0];
    int low = RADII - 1;
    while (low > 0 && held[low] > wanted)
        low--;
    if (low == RADII - 1)
        return radii_m[low];
    double at_m = straight(wanted, held[low], held[low + 1], radii_m[low], radii_m[low + 1]);
    double found = held_at(around, count, at_m);
    if (found > wanted)
        return straight(wanted, held[low], found, radii_m[low], at_m);
    return straight(wanted, found, held[low + 1], at_m, radii_m[low + 1]);
}

/* Twin of radius_m; around is not empty. */
static double radius_around(Around *around, ptrdiff_t count, double confidence,
                            double reach_sds)
{
    double total = 0.0, sd_m = 0.0, radii_m[LANES], held[LANES] = {0};
    for (ptrdiff_t i = 0; i < count; i++) {
        total += around[i].mass;
        sd_m = around[i].sd_m > sd_m ? around[i].sd_m : sd_m;
    }
    double at_m = middle_m(around, count, confidence * total);
    double most_m = at_m + reach_sds * sd_m, least_m = at_m - reach_sds * sd_m;
    least_m = least_m > 0.0 ? least_m : 0.0;
    for (int r = 0; r < LANES; r++)
        radii_m[r] = least_m + (most_m - least_m) * (r < RADII ? r / (RADII - 1.0) : 1.0);
    hold(around, count, radii_m, held);
    return interpolate(around, count, confidence * total, held, radii_m);
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
        around[count++] = (Around){away_m, mass[i], sqrt(variance)};
    }
    if (low >= 0 && count > 0) {
        *radius_m = radius_around(around, count, confidence, 4.0);
    }
    free(around);
    return low < 0 ? (int)low : count > 0 ? 0 : OUT_OF_BOUNDS;
}
