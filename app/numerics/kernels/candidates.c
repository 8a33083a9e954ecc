/* Twin of app.numerics.summary._rivals. */
#include "kernels.h"

#include <stdlib.h>

/* A candidate's place in an order: small enough to be moved about. */
typedef struct {
    double mass;
    uint64_t key; /* by road, sub-segment and direction, forward first */
    ptrdiff_t order;
} Ranked;

static int by_road(const void *left, const void *right)
{
    const Ranked *a = left, *b = right;
    if (a->key != b->key)
        return a->key < b->key ? -1 : 1;
    return (a->order > b->order) - (a->order < b->order);
}

static int by_mass(const void *left, const void *right)
{
    const Ranked *a = left, *b = right;
    if (a->mass != b->mass)
        return a->mass > b->mass ? -1 : 1;
    return by_road(left, right);
}

static uint64_t key_of(const Candidate *one)
{
    return (uint64_t)one->road << 33 | (uint64_t)one->segment << 1 | (uint64_t)(one->sign < 0);
}

/* Entries of the same sub-segment and direction, which lie side by side, become one. */
static ptrdiff_t join(Ranked *ranked, ptrdiff_t runs, Candidate *each)
{
    ptrdiff_t count = 0;
    for (ptrdiff_t i = 0; i < runs; i++) {
        if (count == 0 || ranked[count - 1].key != ranked[i].key) {
            ranked[count++] = ranked[i];
            continue;
        }
        Candidate *best = each + ranked[count - 1].order;
        ranked[count - 1].mass += ranked[i].mass;
        const Candidate *other = each + ranked[i].order;
        if (other->spilled == best->spilled ? other->score > best->score : best->spilled)
            *best = *other;
    }
    return count;
}

/* One a sub-segment and direction, most probable first; ties by road, segment, forward first. */
int list_candidates(const Places *places, const double *mass, const Atlas *atlas,
                    const Spread *spread, Candidates *listed)
{
    Candidates runs = {0};
    int fault = list_runs(places, mass, atlas, spread, &runs);
    size_t room = (size_t)(runs.count > 0 ? runs.count : 1);
    Ranked *ranked = malloc(sizeof *ranked * room);
    listed->each = malloc(sizeof *listed->each * room);
    if (fault == 0 && (ranked == NULL || listed->each == NULL))
        fault = OUT_OF_MEMORY;
    if (fault == 0) {
        for (ptrdiff_t i = 0; i < runs.count; i++)
            ranked[i] = (Ranked){runs.each[i].mass, key_of(runs.each + i), i};
        qsort(ranked, (size_t)runs.count, sizeof *ranked, by_road);
        listed->count = join(ranked, runs.count, runs.each);
        qsort(ranked, (size_t)listed->count, sizeof *ranked, by_mass);
        for (ptrdiff_t i = 0; i < listed->count; i++) {
            listed->each[i] = runs.each[ranked[i].order];
            listed->each[i].mass = ranked[i].mass;
        }
    }
    free(ranked);
    free(runs.each);
    return fault;
}
