/* Python's arguments for odometer.c and chosen.c: lists of stretches. */
#include "under.h"

#include <stdlib.h>

static PyObject *list_of_stretches(const Laid *found, ptrdiff_t count)
{
    PyObject *list = PyList_New(count);
    for (ptrdiff_t i = 0; list != NULL && i < count; i++) {
        PyObject *one = Py_BuildValue("nnnn", (Py_ssize_t)found[i].road, (Py_ssize_t)found[i].sign,
                                      found[i].first, found[i].last);
        if (one == NULL || PyList_SetItem(list, i, one) < 0)
            Py_CLEAR(list);
    }
    return list;
}

PyObject *stretches_about_places(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 9))
        return NULL;
    Places all = places(&call);
    Py_ssize_t roads[1] = {-1};
    const double *step_m = array(&call, 'd', READ, 1, roads);
    const int64_t *size = array(&call, 'l', READ, 1, roads);
    double options[5], width_m = 0.0;
    for (int i = 0; i < 5; i++)
        options[i] = number(&call);
    Heavy heavy = {options[0], options[1], options[2], options[3], options[4]};
    Laid *found = call.failed ? NULL : malloc(sizeof *found * (size_t)all.count);
    if (!call.failed && found == NULL)
        check(&call, OUT_OF_MEMORY);
    ptrdiff_t count = 0;
    if (!call.failed)
        check(&call, count = stretches_about(&all, step_m, size, roads[0], &heavy, &width_m, found));
    PyObject *list = call.failed ? NULL : list_of_stretches(found, count);
    free(found);
    return release(&call, list == NULL ? NULL : Py_BuildValue("dN", width_m, list));
}

PyObject *stretches_of_coarse(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 7))
        return NULL;
    Py_ssize_t count[1] = {-1}, roads[1] = {-1};
    Coarse kept = {.chainage_m = array(&call, 'd', READ, 1, count)};
    kept.road = array(&call, 'l', READ, 1, count);
    kept.sign = array(&call, 'l', READ, 1, count);
    kept.count = call.failed ? 0 : count[0];
    kept.step_m = number(&call);
    kept.joined_m = number(&call);
    const double *step_m = array(&call, 'd', READ, 1, roads);
    const int64_t *size = array(&call, 'l', READ, 1, roads);
    Laid *found = call.failed ? NULL : malloc(sizeof *found * (size_t)(kept.count + 1));
    if (!call.failed && found == NULL)
        check(&call, OUT_OF_MEMORY);
    ptrdiff_t rows = 0;
    if (!call.failed)
        check(&call, rows = join_coarse(&kept, step_m, size, roads[0], found));
    PyObject *list = call.failed ? NULL : list_of_stretches(found, rows);
    free(found);
    return release(&call, list);
}

/* One of a list's tuples: rows and bend of a road, the window's cells there, and where. */
enum { GIVEN = 9 };
typedef struct {
    PyObject *items[GIVEN];
    Call call;
} Held;

/* Every argument but the window's evidence; the error, if any, is in `held`. */
static Laid stretch_of(Held *held, PyObject *tuple, const Told *window)
{
    Call *call = &held->call;
    begin(call, held->items, GIVEN, GIVEN);
    demand(call, PyTuple_Check(tuple) && PyTuple_Size(tuple) == GIVEN, "not nine of a stretch");
    for (Py_ssize_t i = 0; !call->failed && i < GIVEN; i++)
        held->items[i] = PyTuple_GetItem(tuple, i);
    Laid laid = {.told = *window, .along = along(call, 'r')};
    Along bend = along(call, 'b');
    demand(call, bend.cells == laid.along.cells && bend.columns == laid.along.columns,
           "not the bend of these rows");
    laid.along.bend = bend.bend;
    Py_ssize_t cells = 0;
    laid.told.numbers = whole_list(call, PTRDIFF_MAX, &cells);
    demand(call, cells == window->cells, "not a number for each cell");
    laid.road = whole(call);
    laid.sign = whole(call);
    laid.first = whole(call);
    laid.last = whole(call);
    laid.step_m = number(call);
    laid.length_m = number(call);
    demand(call, laid.sign == 1 || laid.sign == -1, "not a direction");
    demand(call, 0 <= laid.first && laid.first <= laid.last && laid.last < laid.along.columns - 2,
           "beyond the road");
    return laid;
}

static PyObject *next_list(Call *call, Py_ssize_t *count)
{
    PyObject *list = call->failed ? NULL : call->arguments[call->next++];
    demand(call, list == NULL || (PyList_Check(list) && PyList_Size(list) > 0), "not a list of any");
    *count = call->failed ? 0 : PyList_Size(list);
    return list;
}

/* Fills in the stretches; how many of them hold arrays. */
static Py_ssize_t hold(Call *call, PyObject *list, Py_ssize_t count, const Told *window,
                       Held *held, Laid *stretches)
{
    Py_ssize_t taken = 0;
    while (!call->failed && taken < count) {
        stretches[taken] = stretch_of(held + taken, PyList_GetItem(list, taken), window);
        call->failed |= held[taken++].call.failed;
    }
    return taken;
}

static Drawing drawing(Call *call)
{
    Py_ssize_t roads[1] = {-1};
    Drawing told = {0};
    told.step_m = array(call, 'd', READ, 1, roads);
    told.roads = roads[0];
    told.lowest = number(call);
    told.around = whole(call);
    told.least = whole(call);
    told.most = whole(call);
    told.parts = whole(call);
    demand(call, 0 <= told.around && told.around < 1000000, "not a number of places");
    demand(call, 0 <= told.most && told.most <= 64, "not a number of rows");
    demand(call, 1 <= told.parts && told.parts < 1000, "not a number of parts");
    return told;
}

PyObject *under_factors(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 24))
        return NULL;
    Told window = told(&call);
    Py_ssize_t count, factors[1] = {-1}, where_size[1] = {-1}, size[1] = {-1}, priors[1] = {-1};
    PyObject *list = next_list(&call, &count);
    Hypotheses hypotheses = {0};
    hypotheses.value = array(&call, 'd', READ, 1, factors);
    hypotheses.log_prior = array(&call, 'd', READ, 1, factors);
    hypotheses.temperature = number(&call);
    Py_ssize_t far = whole(&call);
    hypotheses.from = number(&call);
    demand(&call, 0 <= far && far % 2 == 0 && far < factors[0], "not so many factors");
    hypotheses.farther = far / 2;
    hypotheses.count = factors[0] - far;
    Likelihood terms = likelihood(&call);
    Drawing drawn = drawing(&call);
    Places before = places(&call);
    Py_ssize_t straight = whole(&call);
    demand(&call, 0 <= straight && straight <= before.count, "not a number of these places");
    int64_t *where = array(&call, 'l', WRITE, 1, where_size);
    double *values = array(&call, 'd', WRITE, 1, size);
    double *log_prior = array(&call, 'd', WRITE, 1, priors);
    double *stretched = array(&call, 'd', WRITE, 1, priors);
    Held *held = call.failed ? NULL : malloc(sizeof *held * (size_t)count);
    Laid *stretches = call.failed ? NULL : malloc(sizeof *stretches * (size_t)count);
    if (!call.failed && (held == NULL || stretches == NULL))
        check(&call, OUT_OF_MEMORY);
    Py_ssize_t taken = call.failed ? 0 : hold(&call, list, count, &window, held, stretches);
    ptrdiff_t most = where_size[0] / 2 < size[0] / VALUES ? where_size[0] / 2 : size[0] / VALUES;
    most = call.failed || most - before.count < priors[0] ? most : before.count + priors[0];
    Room room = {most, where, values};
    ptrdiff_t found = 0;
    double together = 0.0;
    if (!call.failed)
        check(&call, found = lay_factors(stretches, count, &hypotheses, &terms, &drawn, &before,
                                         straight, &room, log_prior, stretched, &together));
    while (taken > 0)
        release(&held[--taken].call, NULL);
    free(held);
    free(stretches);
    return release(&call, call.failed ? NULL : Py_BuildValue("nd", found, together));
}
