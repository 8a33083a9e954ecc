/* Twin of app.numerics.spread. */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>

/* A new entry, last of all; NULL without memory. */
static Candidate *add(Candidates *runs, Candidate one)
{
    if (runs->count == runs->room) {
        ptrdiff_t room = runs->room > 0 ? 2 * runs->room : 256;
        Candidate *each = realloc(runs->each, sizeof *each * (size_t)room);
        if (each == NULL)
            return NULL;
        runs->each = each;
        runs->room = room;
    }
    runs->each[runs->count] = one;
    return runs->each + runs->count++;
}

/* The sub-segments of a road, as `edge_m[0]` to `edge_m[count]` bound them. */
typedef struct {
    const double *edge_m;
    int64_t count;
} Edges;

static int edges_of(const Atlas *atlas, int64_t road, int64_t segment, Edges *edges)
{
    int64_t first = atlas->first_edge[road], end = atlas->first_edge[road + 1];
    if (first < 0 || end > atlas->edges || end <= first)
        return OUT_OF_BOUNDS;
    *edges = (Edges){atlas->edge_m + first, end - first - 1};
    return segment >= 0 && segment < edges->count ? 0 : OUT_OF_BOUNDS;
}

/* A place, and how far it is spread. */
typedef struct {
    double at_m, sd_m, reach_sds, mass, score;
} Spilling;

/* Share of a place that lies beyond a sub-segment, one way; none beyond the road's end. */
static double beyond(const Spilling *place, const Edges *edges, int64_t segment, int way)
{
    if (segment == (way > 0 ? edges->count - 1 : 0))
        return 0.0;
    double z = way * (place->at_m - edges->edge_m[segment + (way > 0)]) / place->sd_m;
    if (!(z > -place->reach_sds))
        return 0.0;
    return 1.0 / (1.0 + exp(-2.0 * z * (0.7978846 + 0.035677 * z * z))); /* Page 1977 */
}

/* What lies beyond the sub-segment of run `own` joins the entries of others after that. */
static int spill(Candidates *runs, ptrdiff_t own, const Spilling *place, const Edges *edges,
                 int way, double share)
{
    Candidate entry = runs->each[own];
    while (share > 0.0) {
        entry.segment += way;
        double farther = beyond(place, edges, entry.segment, way);
        Candidate *to = runs->each + own + 1, *end = runs->each + runs->count;
        while (to < end && to->segment != entry.segment)
            to++;
        if (to == end)
            to = add(runs, (Candidate){entry.road, entry.segment, entry.sign, 0.0, -INFINITY, 0.0, 1});
        if (to == NULL)
            return OUT_OF_MEMORY;
        to->mass += place->mass * (share - farther);
        if (place->score > to->score || to->score == -INFINITY) {
            to->score = place->score;
            to->chainage_m = edges->edge_m[entry.segment + (way < 0)];
        }
        share = farther;
    }
    return 0;
}

/* Places one after the other in a sub-segment and direction are one entry, before what they spill. */
int list_runs(const Places *places, const double *mass, const Atlas *atlas, const Spread *spread,
              Candidates *runs)
{
    const double *at_m = places->values + CHAINAGE * places->count;
    const double *width_m = places->values + WIDTH * places->count;
    const double *score = places->values + SCORE * places->count;
    ptrdiff_t own = -1;
    Edges edges = {0};
    for (ptrdiff_t i = 0; i < places->count; i++) {
        double share, up = 0.0, down = 0.0;
        int64_t road = places->road[i], sign = places->sign[i] < 0 ? -1 : 1;
        ptrdiff_t low = spot(atlas, road, at_m[i], &share);
        if (low < 0)
            return (int)low;
        int64_t segment = atlas->segment[low];
        Candidate *run = runs->each + own;
        if (own < 0 || run->road != road || run->segment != segment || run->sign != sign) {
            own = runs->count;
            run = add(runs, (Candidate){road, segment, sign, 0.0, -INFINITY, 0.0, 0});
            int fault = run == NULL ? OUT_OF_MEMORY : edges_of(atlas, road, segment, &edges);
            if (fault != 0)
                return fault;
        }
        if (score[i] > run->score || run->score == -INFINITY) {
            run->score = score[i];
            run->chainage_m = at_m[i];
        }
        if (mass[i] > spread->negligible) {
            double variance = width_m[i] * width_m[i] * (1.0 / 12.0) + spread->sd_m * spread->sd_m;
            Spilling place = {at_m[i], sqrt(variance), spread->reach_sds, mass[i], score[i]};
            up = beyond(&place, &edges, segment, 1);
            down = beyond(&place, &edges, segment, -1);
            run->mass += mass[i] * (1.0 - up - down);
            if (spill(runs, own, &place, &edges, 1, up) < 0 ||
                spill(runs, own, &place, &edges, -1, down) < 0)
                return OUT_OF_MEMORY;
        } else {
            run->mass += mass[i];
        }
    }
    return 0;
}
