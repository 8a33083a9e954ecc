/* app.numerics._native: the kernels as Python functions; app.numerics.native says what they do. */
#include "arrays.h"
#include "under.h"

#include <math.h>
#include <stdlib.h>

static PyObject *heard_columns(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 1))
        return NULL;
    Py_ssize_t shape[2] = {-1, -1};
    const double *rsrp_dbm = array(&call, 'd', READ, 2, shape);
    PyObject *heard = call.failed ? NULL : PyList_New(0);
    call.failed |= heard == NULL;
    for (Py_ssize_t column = 0; !call.failed && column < shape[1]; column++) {
        Py_ssize_t i = 0;
        while (i < shape[0] && isnan(rsrp_dbm[i * shape[1] + column]))
            i++;
        if (i == shape[0])
            continue;
        PyObject *one = PyLong_FromSsize_t(column);
        call.failed = one == NULL || PyList_Append(heard, one) < 0;
        Py_XDECREF(one);
    }
    return release(&call, heard);
}

static PyObject *evidence(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 8))
        return NULL;
    Py_ssize_t shape[2] = {-1, -1}, room[1] = {-1}, cells, carriers;
    const double *distance_m = array(&call, 'd', READ, 1, shape);
    const double *rsrp_dbm = array(&call, 'd', READ, 2, shape);
    const ptrdiff_t *columns = whole_list(&call, shape[1], &cells);
    const ptrdiff_t *carrier = whole_list(&call, PTRDIFF_MAX, &carriers);
    demand(&call, carriers == cells, "not a carrier for each cell");
    for (Py_ssize_t i = 0; !call.failed && i < cells; i++)
        demand(&call, columns[i] >= 0, "a column out of range");
    double step_m = number(&call), centre_dbm = number(&call), correlation_m = number(&call);
    double *block = array(&call, 'd', WRITE, 1, room);
    demand(&call, shape[0] >= 1 && 2 + 3 * cells <= room[0] / shape[0], "too little room");
    ptrdiff_t stretches = 0;
    if (!call.failed) {
        stretches = count_stretches(distance_m, shape[0], step_m);
        gather_evidence(distance_m, rsrp_dbm, shape[0], shape[1], columns, carrier, cells, step_m,
                        centre_dbm, correlation_m, stretches, block);
    }
    return release(&call, call.failed ? NULL : PyLong_FromSsize_t(stretches));
}

static Field any_field(Call *call)
{
    Field field;
    field.mean_db2 = number(call);
    field.field_db2 = number(call);
    field.field_m = number(call);
    field.noise_db2 = number(call);
    field.reading_log = number(call);
    return field;
}

static PyObject *elsewhere(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 9))
        return NULL;
    Py_ssize_t room[1] = {-1};
    const double *block = array(&call, 'd', READ, 1, room);
    ptrdiff_t samples = whole(&call), cells = whole(&call);
    Field field = any_field(&call);
    double temperature = number(&call);
    demand(&call, samples >= 1 && cells >= 0 && cells < room[0] && 2 + 2 * cells <= room[0] / samples,
           "the block holds fewer numbers");
    double log_evidence = 0.0;
    if (!call.failed)
        check(&call, weigh_elsewhere(block, samples, cells, &field, temperature, &log_evidence));
    return release(&call, call.failed ? NULL : PyFloat_FromDouble(log_evidence));
}

static PyObject *without_wild(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 8))
        return NULL;
    Py_ssize_t shape[2] = {-1, -1};
    const double *distance_m = array(&call, 'd', READ, 1, shape);
    const double *rsrp_dbm = array(&call, 'd', READ, 2, shape);
    Hampel filter;
    filter.neighbours = whole(&call);
    filter.least = whole(&call);
    filter.reach_m = number(&call);
    filter.sure_db = number(&call);
    filter.times = number(&call);
    double *left_dbm = array(&call, 'd', WRITE, 2, shape);
    demand(&call, 1 <= filter.neighbours && filter.neighbours <= 4, "too many neighbours");
    demand(&call, 2 <= filter.least, "a median of itself");
    ptrdiff_t wild = 0;
    if (!call.failed) {
        wild = leave_out_wild(distance_m, rsrp_dbm, shape[0], shape[1], &filter, left_dbm);
        check(&call, wild);
    }
    return release(&call, call.failed ? NULL : PyLong_FromSsize_t(wild));
}

static PyObject *listen(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 6))
        return NULL;
    Py_ssize_t room[1] = {-1}, cells[1] = {-1};
    double *block = array(&call, 'd', WRITE, 1, room);
    ptrdiff_t samples = whole(&call);
    const double *usual = array(&call, 'd', READ, 1, cells);
    double few = number(&call), enough = number(&call), least = number(&call);
    double times = 1.0, readings = 0.0;
    demand(&call, samples >= 1 && 2 + 3 * cells[0] <= room[0] / samples,
           "the block holds fewer numbers");
    if (!call.failed)
        times = listen_to(block, samples, cells[0], usual, few, enough, least, &readings);
    return release(&call, call.failed ? NULL : Py_BuildValue("dd", times, readings));
}

static PyObject *this_road(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 25))
        return NULL;
    Told window = told(&call);
    Along profile = along(&call, 'r');
    OnRoad at;
    at.low = whole(&call);
    at.share = number(&call);
    at.sign = whole(&call);
    at.step_m = number(&call);
    at.factor = number(&call);
    Laws laws;
    laws.drift_db2 = number(&call);
    laws.drift_m = number(&call);
    laws.much_drift_db2 = number(&call);
    laws.much_drift_m = number(&call);
    laws.shadowing_db2 = number(&call);
    laws.shadowing_m = number(&call);
    laws.noise_times = number(&call);
    laws.background_log = number(&call);
    laws.temperature = number(&call);
    Field field = any_field(&call);
    Likelihood devices = likelihood(&call);
    demand(&call, at.sign == 1 || at.sign == -1, "not a direction");
    demand(&call, 0 <= at.low && at.low < profile.columns - 3, "beyond the road");
    demand(&call, laws.noise_times > 0.0, "no noise");
    double found[5] = {0.0, 0.0, 0.0, 0.0, 0.0};
    if (!call.failed)
        check(&call, weigh_this_road(&window, &profile, &at, &laws, &field, &devices, found));
    return release(&call, call.failed ? NULL
                                      : Py_BuildValue("ddddd", found[0], found[1], found[2],
                                                      found[3], found[4]));
}

static PyObject *tape(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, given == 12 ? 12 : 10)) /* with arms, or without */
        return NULL;
    Told window = told(&call);
    Tape profile = tape_of(&call);
    Py_ssize_t count[1] = {-1};
    const int64_t *positions = array(&call, 'l', READ, 1, count);
    double step_m = number(&call);
    Likelihood terms = likelihood(&call);
    count[0] = call.failed ? -1 : 2 * count[0];
    float *score = array(&call, 'f', WRITE, 1, count);
    Arms arms = {0};
    float *parts = NULL;
    if (given == 12) {
        Py_ssize_t where_shape[2] = {3, -1};
        const int64_t *where = array(&call, 'l', READ, 2, where_shape);
        Py_ssize_t shape[3] = {where_shape[1], 1 + 2 * window.groups, -1};
        parts = array(&call, 'f', WRITE, 3, shape);
        if (!call.failed)
            arms = (Arms){shape[0], shape[2], where, where + shape[0], where + 2 * shape[0]};
    }
    if (!call.failed)
        check(&call, score_tape(&window, &profile, positions, count[0] / 2, step_m, &terms, score,
                                &arms, parts));
    return release(&call, call.failed ? NULL : Py_NewRef(Py_None));
}

static PyObject *turns(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 8))
        return NULL;
    Py_ssize_t part_shape[3] = {-1, -1, -1}, count[1] = {-1};
    const float *parts = array(&call, 'f', READ, 3, part_shape);
    const int64_t *onto = array(&call, 'l', READ, 1, count);
    const int64_t *off = array(&call, 'l', READ, 1, count);
    const int64_t *room = array(&call, 'l', READ, 1, count);
    ptrdiff_t first = whole(&call), last = whole(&call);
    Likelihood terms = likelihood(&call);
    Py_ssize_t shape[2] = {count[0], part_shape[2]};
    float *score = array(&call, 'f', WRITE, 2, shape);
    demand(&call, first >= 1 && last <= shape[1], "no column that a window may end at");
    demand(&call, part_shape[1] >= 3 && part_shape[1] % 2 == 1, "no residual and weight each");
    Turns every = {count[0], shape[1], onto, off, room};
    if (!call.failed)
        check(&call, score_turns(parts, part_shape[0], part_shape[1], &every, first, last, &terms, score));
    return release(&call, call.failed ? NULL : Py_NewRef(Py_None));
}

static PyObject *kept_by_mass(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 5))
        return NULL;
    Py_ssize_t count[1] = {-1}, room[1] = {-1};
    const float *score = array(&call, 'f', READ, 1, count);
    double temperature = number(&call), left_out = number(&call);
    ptrdiff_t most = whole(&call), found = 0;
    int64_t *kept = array(&call, 'l', WRITE, 1, room);
    demand(&call, room[0] >= count[0] || room[0] >= most, "too little room");
    if (!call.failed)
        check(&call, found = keep_by_mass(score, count[0], temperature, left_out, most, kept));
    return release(&call, call.failed ? NULL : PyLong_FromSsize_t(found));
}

static PyObject *heaviest(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 6))
        return NULL;
    Py_ssize_t count[1] = {-1}, room[1] = {-1};
    const float *score = array(&call, 'f', READ, 1, count);
    double temperature = number(&call), left_out = number(&call), not_looked_at = number(&call);
    ptrdiff_t most = whole(&call), found = 0;
    int64_t *kept = array(&call, 'l', WRITE, 1, room);
    demand(&call, most >= 0 && room[0] > most, "too little room");
    int all = 0;
    double total = 0.0;
    if (!call.failed)
        check(&call, found = keep_heaviest(score, count[0], temperature, left_out, not_looked_at,
                                           most, kept, &all, &total));
    return release(&call, call.failed ? NULL : Py_BuildValue("nNd", found, PyBool_FromLong(all),
                                                             total));
}

static PyObject *rest(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 10))
        return NULL;
    Py_ssize_t count[1] = {-1}, runs[1] = {-1}, many[1] = {-1};
    const float *score = array(&call, 'f', READ, 1, count);
    const int64_t *starts = array(&call, 'l', READ, 1, runs);
    const int64_t *covered = array(&call, 'l', READ, 1, many);
    double temperature = number(&call), step_m = number(&call), highest = number(&call);
    double aligned_m = number(&call), left_out = number(&call);
    int64_t *best = array(&call, 'l', WRITE, 1, runs);
    double *width_m = array(&call, 'd', WRITE, 1, runs);
    Scale scale = {temperature, step_m, highest, aligned_m};
    ptrdiff_t kept = 0;
    if (!call.failed)
        check(&call, kept = sum_rest(score, count[0], starts, runs[0], covered, many[0], &scale,
                                     left_out, best, width_m));
    return release(&call, call.failed ? NULL : PyLong_FromSsize_t(kept));
}

static PyObject *with_neighbours(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 5))
        return NULL;
    Py_ssize_t places[1] = {-1}, rows[1] = {-1}, room[1] = {-1};
    const int64_t *number_of = array(&call, 'l', READ, 1, places);
    const int64_t *row = array(&call, 'l', READ, 1, rows);
    const int64_t *here = array(&call, 'l', READ, 1, rows);
    ptrdiff_t scores = whole(&call), found = 0;
    int64_t *with = array(&call, 'l', WRITE, 1, room);
    demand(&call, room[0] / 3 >= rows[0], "not room for three times as many");
    if (!call.failed)
        check(&call, found = add_neighbours(number_of, places[0], row, here, rows[0], scores, with));
    return release(&call, call.failed ? NULL : PyLong_FromSsize_t(found));
}

static PyObject *stretch(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 15))
        return NULL;
    Told window = told(&call);
    Along profile = along(&call, 'r');
    ptrdiff_t road = whole(&call), sign = whole(&call), first = whole(&call), last = whole(&call);
    double step_m = number(&call), length_m = number(&call);
    Likelihood terms = likelihood(&call);
    Py_ssize_t shape[2] = {2, -1};
    int64_t *where = array(&call, 'l', WRITE, 2, shape);
    shape[0] = VALUES;
    double *values = array(&call, 'd', WRITE, 2, shape);
    ptrdiff_t at = whole(&call), count = last - first + 1, total = shape[1];
    demand(&call, sign == 1 || sign == -1, "not a direction");
    demand(&call, 0 <= first && first <= last && last < profile.columns - 2, "beyond the road");
    demand(&call, 0 <= at && at <= total - count, "too little room");
    Laid laid = {window, profile, road, sign, first, last, step_m, length_m};
    Room room = {total, where, values};
    if (!call.failed)
        check(&call, lay_stretch(&laid, &terms, &room, at));
    return release(&call, call.failed ? NULL : Py_NewRef(Py_None));
}

static PyObject *list_of_rows(const Places *all, const Row *rows, ptrdiff_t count)
{
    PyObject *list = PyList_New(0);
    for (ptrdiff_t i = 0; list != NULL && i < count; i++) {
        PyObject *row = Py_BuildValue("nnn", (Py_ssize_t)all->road[rows[i].first], rows[i].first,
                                      rows[i].end);
        if (row == NULL || PyList_Append(list, row) < 0)
            Py_CLEAR(list);
        Py_XDECREF(row);
    }
    return list;
}

static PyObject *rows(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    enum { MOST = 64 };
    Row found[MOST];
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 7))
        return NULL;
    Places all = places(&call);
    Py_ssize_t roads[1] = {-1};
    const double *step_m = array(&call, 'd', READ, 1, roads);
    double lowest = number(&call);
    ptrdiff_t around = whole(&call), least = whole(&call), most = whole(&call), count = 0;
    demand(&call, around >= 0 && around < PTRDIFF_MAX / 2 - all.count, "not a number of places");
    demand(&call, most >= 0 && most <= MOST, "not a number of rows");
    if (!call.failed)
        check(&call, count = find_rows(&all, step_m, roads[0], lowest, around, least, most, found));
    return release(&call, call.failed ? NULL : list_of_rows(&all, found, count));
}

static PyObject *redrawn(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 14))
        return NULL;
    Told window = told(&call);
    Along profile = along(&call, 'b');
    Places all = places(&call);
    ptrdiff_t first = whole(&call), end = whole(&call), parts = whole(&call);
    demand(&call, 0 <= first && first + 1 < end && end <= all.count, "no row of places");
    demand(&call, 1 <= parts && parts < 1000, "not a number of parts");
    double step_m = number(&call), like_db2 = number(&call);
    Py_ssize_t shape[2] = {2, call.failed ? 0 : all.count + (parts - 1) * (end - first - 1)};
    int64_t *where = array(&call, 'l', WRITE, 2, shape);
    shape[0] = VALUES;
    double *values = array(&call, 'd', WRITE, 2, shape);
    Room room = {shape[1], where, values};
    if (!call.failed)
        check(&call, redraw(&window, &profile, &all, first, end, parts, step_m, like_db2, &room));
    return release(&call, call.failed ? NULL : Py_NewRef(Py_None));
}

/* Road, sub-segment, direction, mass, chainage, longitude and latitude; NULL with an error set. */
static PyObject *tuple_of(const Candidate *one, const Atlas *map)
{
    double share;
    ptrdiff_t low = spot(map, one->road, one->chainage_m, &share);
    double numbers[4] = {one->mass, one->chainage_m, between(map, LON, low, share),
                         between(map, LAT, low, share)};
    int64_t wholes[3] = {one->road, one->segment, one->sign};
    PyObject *tuple = PyTuple_New(7);
    for (int i = 0; tuple != NULL && i < 7; i++) {
        PyObject *item = i < 3 ? PyLong_FromLongLong(wholes[i]) : PyFloat_FromDouble(numbers[i - 3]);
        if (item == NULL || PyTuple_SetItem(tuple, i, item) < 0) /* which takes the item */
            Py_CLEAR(tuple);
    }
    return tuple;
}

static PyObject *list_of(const Candidates *listed, const Atlas *map, double negligible)
{
    ptrdiff_t wanted = 0;
    while (wanted < listed->count && listed->each[wanted].mass > negligible)
        wanted++;
    PyObject *list = PyList_New(wanted);
    for (ptrdiff_t i = 0; list != NULL && i < wanted; i++) {
        PyObject *one = tuple_of(listed->each + i, map);
        if (one == NULL || PyList_SetItem(list, i, one) < 0)
            Py_CLEAR(list);
    }
    return list;
}

/* What app.numerics.summary draws from places, in one go. */
static PyObject *summed_up(Call *call, const Places *all, const Atlas *map, double *mass,
                           const double options[10])
{
    ptrdiff_t road, peak, low;
    double road_mass, chainage_m, share = 0.0, radius_m = 0.0, light = 0.0;
    share_mass(all, options[0], mass);
    for (ptrdiff_t i = 0; i < all->count; i++)
        light += mass[i] <= options[7] ? mass[i] : 0.0;
    check(call, find_summit(all, mass, map->roads, options[1], options[2], &road,
                            &road_mass, &peak, &chainage_m));
    check(call, low = call->failed ? 0 : spot(map, road, chainage_m, &share));
    if (call->failed)
        return NULL;
    double x_m = between(map, X_M, low, share), y_m = between(map, Y_M, low, share);
    double negligible = light > options[8] ? -1.0 : options[7]; /* -1: none is */
    check(call, radius(all, mass, map, x_m, y_m, options[3], options[4], negligible, &radius_m));
    Spread spread = {options[5], options[6], negligible};
    Candidates listed = {0};
    check(call, call->failed ? 0 : list_candidates(all, mass, map, &spread, &listed));
    PyObject *list = call->failed ? NULL : list_of(&listed, map, options[9]);
    free(listed.each);
    if (list == NULL)
        return NULL;
    return Py_BuildValue("ndndddddN", road, road_mass, peak, chainage_m,
                         between(map, LON, low, share), between(map, LAT, low, share),
                         map->plane[HEADING * map->grid + low], radius_m, list);
}

/* One of a list's tuples as a candidate: a named tuple of its own kind, whose items are handed in. */
static PyObject *candidate(PyTypeObject *kind, PyObject *tuple, PyObject *names, PyObject *forward,
                           PyObject *backward, double share)
{
    if (!PyTuple_Check(tuple) || PyTuple_Size(tuple) != 7)
        return PyErr_Format(PyExc_TypeError, "not seven of a rival");
    Py_ssize_t road = PyNumber_AsSsize_t(PyTuple_GetItem(tuple, 0), PyExc_OverflowError);
    double sign = PyFloat_AsDouble(PyTuple_GetItem(tuple, 2));
    double mass = PyFloat_AsDouble(PyTuple_GetItem(tuple, 3));
    if (PyErr_Occurred())
        return NULL;
    if (road < 0 || road >= PyTuple_Size(names))
        return PyErr_Format(PyExc_ValueError, "no road %zd", road);
    PyObject *one = PyType_GenericAlloc(kind, 7);
    PyObject *posterior = one == NULL ? NULL : PyFloat_FromDouble(mass * share);
    if (posterior == NULL) {
        Py_XDECREF(one);
        return NULL;
    }
    PyTuple_SetItem(one, 0, Py_NewRef(PyTuple_GetItem(names, road)));
    PyTuple_SetItem(one, 1, Py_NewRef(PyTuple_GetItem(tuple, 1)));
    PyTuple_SetItem(one, 2, Py_NewRef(sign > 0.0 ? forward : backward));
    PyTuple_SetItem(one, 3, posterior);
    for (int i = 4; i < 7; i++)
        PyTuple_SetItem(one, i, Py_NewRef(PyTuple_GetItem(tuple, i)));
    return one;
}

/* Twin of app.numerics.answer._candidates. */
static PyObject *candidates(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 6))
        return NULL;
    PyObject *kind = arguments[0], *rivals = arguments[1], *names = arguments[2];
    call.next = 5;
    double share = number(&call);
    demand(&call, PyType_Check(kind) && PyType_IsSubtype((PyTypeObject *)kind, &PyTuple_Type),
           "not a kind of tuple");
    demand(&call, PyList_Check(rivals) && PyTuple_Check(names), "not a list of rivals, and names");
    Py_ssize_t count = call.failed ? 0 : PyList_Size(rivals);
    PyObject *found = call.failed ? NULL : PyTuple_New(count);
    for (Py_ssize_t i = 0; found != NULL && i < count; i++) {
        PyObject *one = candidate((PyTypeObject *)kind, PyList_GetItem(rivals, i), names,
                                  arguments[3], arguments[4], share);
        if (one == NULL || PyTuple_SetItem(found, i, one) < 0)
            Py_CLEAR(found);
    }
    return release(&call, found);
}

static PyObject *summary(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 19))
        return NULL;
    Places all = places(&call);
    Atlas map = atlas(&call);
    double options[10]; /* temperature, two each of peak, radius, spread, three of negligible */
    for (int i = 0; i < 10; i++)
        options[i] = number(&call);
    double *mass = call.failed ? NULL : malloc(sizeof *mass * (size_t)all.count);
    if (!call.failed && mass == NULL)
        check(&call, OUT_OF_MEMORY);
    PyObject *found = call.failed ? NULL : summed_up(&call, &all, &map, mass, options);
    free(mass);
    return release(&call, found);
}

static PyObject *joined(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 3))
        return NULL;
    Py_ssize_t rows[1] = {-1};
    const int64_t *base = array(&call, 'l', READ, 1, rows);
    const int64_t *code = array(&call, 'l', READ, 1, rows);
    int64_t *joint = array(&call, 'l', WRITE, 1, rows);
    if (!call.failed)
        check(&call, join_values(base, code, rows[0], joint));
    return release(&call, call.failed ? NULL : Py_NewRef(Py_None));
}

static PyObject *gains(PyObject *self, PyObject *const *arguments, Py_ssize_t given)
{
    Call call;
    (void)self;
    if (!begin(&call, arguments, given, 4))
        return NULL;
    Py_ssize_t shape[2] = {-1, -1}, rows[1] = {-1};
    const int64_t *base = array(&call, 'l', READ, 1, rows);
    shape[1] = rows[0];
    const int64_t *codes = array(&call, 'l', READ, 2, shape);
    const int64_t *label = array(&call, 'l', READ, 1, rows);
    double *gain_bits = array(&call, 'd', WRITE, 1, shape);
    if (!call.failed)
        check(&call, information_gains(base, codes, label, rows[0], shape[0], gain_bits));
    return release(&call, call.failed ? NULL : Py_NewRef(Py_None));
}

#define KERNEL(name) {#name, (PyCFunction)(void (*)(void))name, METH_FASTCALL, NULL}

static PyMethodDef methods[] = {
    KERNEL(heard_columns), KERNEL(evidence), KERNEL(tape), KERNEL(turns),   KERNEL(kept_by_mass),
    KERNEL(heaviest),      KERNEL(rest),     KERNEL(stretch), KERNEL(rows),    KERNEL(redrawn),
    KERNEL(summary),       KERNEL(joined),   KERNEL(gains),
    {"stretches_about", (PyCFunction)(void (*)(void))stretches_about_places, METH_FASTCALL, NULL},
    KERNEL(under_factors), KERNEL(elsewhere), KERNEL(listen), KERNEL(this_road),
    KERNEL(without_wild),  KERNEL(with_neighbours), KERNEL(candidates),
    {"stretches_of_coarse", (PyCFunction)(void (*)(void))stretches_of_coarse, METH_FASTCALL, NULL},
    {NULL, NULL, 0, NULL},
};

static int set_version(PyObject *module)
{
    /* app.numerics.native refuses a library built from other sources than its own. */
    return PyModule_AddIntConstant(module, "VERSION", 28);
}

static PyModuleDef_Slot slots[] = {{Py_mod_exec, (void *)set_version}, {0, NULL}};

static PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_native", "The numeric core in C.", 0, methods, slots, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__native(void)
{
    return PyModuleDef_Init(&definition);
}
