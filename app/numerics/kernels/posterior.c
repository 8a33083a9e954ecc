/* Twins of app.numerics.posterior's kept_by_mass, heaviest, masses, and app.numerics.answer's peak. */
#include "kernels.h"

#include "approximate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BUCKETS = 1024, LANES = 16 };

typedef struct {
    float score;
    ptrdiff_t index;
} Scored;

/* Higher scores first, equal ones as they stood. */
static int before(const void *left, const void *right)
{
    const Scored *a = left, *b = right;
    if (a->score != b->score)
        return a->score > b->score ? -1 : 1;
    return (a->index > b->index) - (a->index < b->index);
}

/* Places by how far they lie under the top: those of a bucket all outweigh those of the next. */
typedef struct {
    double top, per_bucket, temperature, cut;
    double mass[BUCKETS], total;
    ptrdiff_t count[BUCKETS];
} Sorted;

static int bucket_of(const Sorted *sorted, float score)
{
    double at = (sorted->top - (double)score) * sorted->per_bucket;
    return at < BUCKETS - 1 ? (int)at : BUCKETS - 1;
}

FOR_EACH_MACHINE
static float highest_of(const float *score, ptrdiff_t count)
{
    float top[LANES];
    for (int lane = 0; lane < LANES; lane++)
        top[lane] = -INFINITY;
    for (ptrdiff_t i = 0; i + LANES <= count; i += LANES)
        for (int lane = 0; lane < LANES; lane++)
            top[lane] = score[i + lane] > top[lane] ? score[i + lane] : top[lane];
    for (ptrdiff_t i = count - count % LANES; i < count; i++)
        top[0] = score[i] > top[0] ? score[i] : top[0];
    for (int lane = 1; lane < LANES; lane++)
        top[0] = top[lane] > top[0] ? top[lane] : top[0];
    return top[0];
}

static void sort_roughly(Sorted *sorted, const float *score, ptrdiff_t count, double temperature)
{
    float top = highest_of(score, count);
    /* What lies under the cut is a billionth of the total together: not worth its exponentials. */
    double span = -temperature * log(1e-9 / (double)count);
    *sorted = (Sorted){.top = top, .per_bucket = BUCKETS / span, .temperature = temperature,
                       .cut = top - span};
    for (ptrdiff_t i = 0; i < count; i++)
        if (score[i] >= sorted->cut) {
            double mass = exp(((double)score[i] - sorted->top) / temperature);
            int bucket = bucket_of(sorted, score[i]);
            sorted->mass[bucket] += mass;
            sorted->count[bucket]++;
            sorted->total += mass;
        }
}

/* The last place to be kept: the one within a bucket that brings the sum to `wanted`. */
static Scored last_of_bucket(const Sorted *sorted, int bucket, const float *score, ptrdiff_t count,
                             double sum, double wanted, ptrdiff_t most, Scored *room)
{
    ptrdiff_t found = 0, last = 0;
    for (ptrdiff_t i = 0; i < count && found < sorted->count[bucket]; i++)
        if (score[i] >= sorted->cut && bucket_of(sorted, score[i]) == bucket)
            room[found++] = (Scored){score[i], i};
    qsort(room, (size_t)found, sizeof *room, before);
    for (; last < found - 1 && last < most - 1; last++) {
        sum += exp(((double)room[last].score - sorted->top) / sorted->temperature);
        if (sum >= wanted)
            break;
    }
    return room[last];
}

/* Equal scores in the order of their indices. */
static ptrdiff_t keep(const Sorted *sorted, const float *score, ptrdiff_t count, double left_out,
                      ptrdiff_t most, int64_t *kept)
{
    double wanted = (1.0 - left_out) * sorted->total, sum = 0.0;
    ptrdiff_t enough = 0, found = 0;
    int bucket = 0;
    for (; bucket < BUCKETS - 1; bucket++) {
        if (sum + sorted->mass[bucket] >= wanted || enough + sorted->count[bucket] >= most)
            break;
        sum += sorted->mass[bucket];
        enough += sorted->count[bucket];
    }
    if (most <= 0 || enough + sorted->count[bucket] == 0)
        return 0;
    Scored last = {-INFINITY, count};
    if (sorted->count[bucket] > 0) {
        Scored *room = malloc(sizeof *room * (size_t)sorted->count[bucket]);
        if (room == NULL)
            return OUT_OF_MEMORY;
        last = last_of_bucket(sorted, bucket, score, count, sum, wanted, most - enough, room);
        free(room);
    }
    for (ptrdiff_t i = 0; i < count && found < most; i++)
        if (score[i] >= sorted->cut &&
            (score[i] > last.score || (score[i] == last.score && i <= last.index)))
            kept[found++] = i;
    return found;
}

ptrdiff_t keep_by_mass(const float *score, ptrdiff_t count, double temperature, double left_out,
                       ptrdiff_t most, int64_t *kept)
{
    Sorted sorted;
    sort_roughly(&sorted, score, count, temperature);
    return keep(&sorted, score, count, left_out, most, kept);
}

/* `kept` has room for one more than `most`. */
ptrdiff_t keep_heaviest(const float *score, ptrdiff_t count, double temperature, double left_out,
                        double not_looked_at, ptrdiff_t most, int64_t *kept, int *whole,
                        double *total)
{
    Sorted sorted;
    sort_roughly(&sorted, score, count, temperature);
    *total = sorted.total;
    ptrdiff_t found = keep(&sorted, score, count, left_out, most + 1, kept);
    *whole = found <= most;
    return *whole ? found : keep(&sorted, score, count, not_looked_at, most, kept);
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
