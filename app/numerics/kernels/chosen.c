/* Twins of app.numerics.coarse.Scored.with_neighbours and app.numerics.matching.stretches_of. */
#include "kernels.h"

#include <math.h>

/* Indices, increasing, and those beside them whose places are neighbours on a road; `with` has room
 * for three times as many. `here` says which of all places each index is. */
ptrdiff_t add_neighbours(const int64_t *number, ptrdiff_t places, const int64_t *rows,
                         const int64_t *here, ptrdiff_t count, ptrdiff_t scores, int64_t *with)
{
    ptrdiff_t found = 0;
    int64_t last = -1;
    for (ptrdiff_t i = 0; i < count; i++) {
        int64_t row = rows[i], at = here[i];
        if (row < 0 || row >= scores || at < 0 || at >= places || (i > 0 && row <= rows[i - 1]))
            return OUT_OF_BOUNDS;
        int64_t before = at > 0 && number[at] - number[at - 1] == 1 ? row - 1 : row;
        int64_t after = at + 1 < places && number[at + 1] - number[at] == 1 ? row + 1 : row;
        if (before < 0 || after >= scores)
            return OUT_OF_BOUNDS;
        for (int64_t each = before > last ? before : last + 1; each <= after; each++)
            with[found++] = last = each;
    }
    return found;
}

/* Whether a coarse position goes on where the one before it ended. */
static int goes_on(const Coarse *kept, ptrdiff_t i)
{
    return kept->road[i] == kept->road[i - 1] && kept->sign[i] == kept->sign[i - 1] &&
           kept->chainage_m[i] - kept->chainage_m[i - 1] <= kept->joined_m;
}

/* Grid positions of every unbroken row of coarse positions; how many rows there are. */
ptrdiff_t join_coarse(const Coarse *kept, const double *step_m, const int64_t *size,
                      ptrdiff_t roads, Laid *found)
{
    ptrdiff_t rows = 0, start = 0;
    for (ptrdiff_t end = 1; end <= kept->count; end++) {
        if (end < kept->count && goes_on(kept, end))
            continue;
        int64_t road = kept->road[start];
        if (road < 0 || road >= roads)
            return OUT_OF_BOUNDS;
        double from = (kept->chainage_m[start] - kept->step_m) / step_m[road];
        double to = (kept->chainage_m[end - 1] + kept->step_m) / step_m[road];
        if (!(fabs(from) < MOST_COLUMNS && fabs(to) < MOST_COLUMNS))
            return OUT_OF_BOUNDS;
        ptrdiff_t first = from > 0.0 ? (ptrdiff_t)from : 0, last = (ptrdiff_t)to + 1;
        last = last < size[road] ? last : (ptrdiff_t)size[road] - 1;
        found[rows++] = (Laid){.road = road, .sign = kept->sign[start], .first = first, .last = last};
        start = end;
    }
    return rows;
}
