#include "arrays.h"

#include <stdlib.h>
#include <string.h>

int begin(Call *call, PyObject *const *arguments, Py_ssize_t given, Py_ssize_t wanted)
{
    call->arguments = arguments;
    call->next = 0;
    call->held = 0;
    call->failed = given != wanted;
    call->listed = 0;
    if (call->failed)
        PyErr_Format(PyExc_TypeError, "%zd arguments needed, %zd given", wanted, given);
    return !call->failed;
}

static PyObject *next(Call *call)
{
    return call->failed ? NULL : call->arguments[call->next++];
}

void demand(Call *call, int holds, const char *what)
{
    if (call->failed || holds)
        return;
    PyErr_Format(PyExc_ValueError, "argument %zd: %s", call->next, what);
    call->failed = 1;
}

void check(Call *call, ptrdiff_t answer)
{
    if (call->failed || answer >= 0)
        return;
    call->failed = 1;
    if (answer == OUT_OF_MEMORY)
        PyErr_NoMemory();
    else
        PyErr_SetString(PyExc_ValueError, "a number in the arrays lies outside what it counts");
}

static int fits(const Py_buffer *view, char type)
{
    size_t size = type == 'f' ? sizeof(float) : sizeof(double);
    if (view->format == NULL || view->format[0] == 0 || view->format[1] != 0)
        return 0;
    int alike = view->format[0] == type || (type == 'l' && view->format[0] == 'q');
    return alike && (size_t)view->itemsize == size && (uintptr_t)view->buf % size == 0;
}

void *array(Call *call, char type, Use use, int dimensions, Py_ssize_t shape[])
{
    PyObject *given = next(call);
    if (given == NULL)
        return NULL;
    Py_buffer *view = call->views + call->held;
    int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (use == WRITE ? PyBUF_WRITABLE : 0);
    if (PyObject_GetBuffer(given, view, flags) < 0) {
        call->failed = 1;
        return NULL;
    }
    call->held++;
    demand(call, fits(view, type), "not the dtype that is needed here");
    demand(call, view->ndim == dimensions, "not the number of dimensions that is needed here");
    for (int axis = 0; !call->failed && axis < dimensions; axis++) {
        demand(call, shape[axis] < 0 || shape[axis] == view->shape[axis],
               "not the shape that is needed here");
        shape[axis] = view->shape[axis];
    }
    return call->failed ? NULL : view->buf;
}

double number(Call *call)
{
    PyObject *given = next(call);
    double value = given == NULL ? 0.0 : PyFloat_AsDouble(given);
    call->failed |= given != NULL && value == -1.0 && PyErr_Occurred() != NULL;
    return value;
}

static ptrdiff_t whole_of(Call *call, PyObject *given)
{
    Py_ssize_t value = given == NULL ? 0 : PyNumber_AsSsize_t(given, PyExc_OverflowError);
    call->failed |= given != NULL && value == -1 && PyErr_Occurred() != NULL;
    return value;
}

ptrdiff_t whole(Call *call)
{
    return whole_of(call, next(call));
}

const ptrdiff_t *whole_list(Call *call, ptrdiff_t end, Py_ssize_t *count)
{
    PyObject *given = next(call);
    demand(call, given == NULL || PyList_Check(given), "not a list");
    *count = call->failed ? 0 : PyList_Size(given);
    if (call->failed)
        return NULL;
    ptrdiff_t *numbers = malloc(sizeof *numbers * (size_t)(*count + 1));
    if (numbers == NULL) {
        check(call, OUT_OF_MEMORY);
        return NULL;
    }
    call->lists[call->listed++] = numbers;
    for (Py_ssize_t i = 0; !call->failed && i < *count; i++) {
        numbers[i] = whole_of(call, PyList_GetItem(given, i));
        demand(call, numbers[i] >= -1 && numbers[i] < end, "a number out of range");
    }
    return numbers;
}

Told told(Call *call)
{
    Py_ssize_t shape[1] = {-1}, cells = 0;
    const double *block = array(call, 'd', READ, 1, shape);
    ptrdiff_t samples = whole(call);
    const ptrdiff_t *numbers = whole_list(call, PTRDIFF_MAX, &cells);
    Py_ssize_t listed = 0;
    const ptrdiff_t *group = whole_list(call, PTRDIFF_MAX, &listed);
    demand(call, listed == cells, "not a group for each cell");
    ptrdiff_t groups = 1;
    for (Py_ssize_t i = 0; !call->failed && i < cells; i++) {
        demand(call, 0 <= group[i] && group[i] < cells, "a group out of range");
        groups = group[i] < groups ? groups : group[i] + 1;
    }
    demand(call, samples >= 1 && samples <= shape[0] && 2 + 3 * cells <= shape[0] / samples,
           "more samples or cells than the block holds");
    if (call->failed)
        return (Told){0};
    const double *level_db = block + 2 * samples, *heard = level_db + samples * cells;
    return (Told){samples, cells, block, block + samples, level_db, heard, heard + samples * cells,
                  numbers, group, groups};
}

Along along(Call *call, char row)
{
    Py_ssize_t shape[2] = {-1, -1};
    const float *values = array(call, 'f', READ, 2, shape);
    demand(call, shape[1] >= 3, "a profile of no road");
    if (row == 'b')
        return (Along){NULL, values, shape[0], shape[1]};
    demand(call, shape[0] >= 1 && (shape[0] - 1) % TERMS == 0, "no whole number of cells");
    return (Along){values, NULL, (shape[0] - 1) / TERMS, shape[1]};
}

Tape tape_of(Call *call)
{
    Py_ssize_t shape[4] = {-1, -1, MERGED, BLOCK}, columns[1] = {-1};
    const float *blocks = array(call, 'f', READ, 4, shape);
    const float *outside = array(call, 'f', READ, 1, columns);
    demand(call, columns[0] % BLOCK == 0 && columns[0] / BLOCK == shape[1],
           "not a column for each of the blocks'");
    return (Tape){blocks, outside, shape[0], columns[0]};
}

Likelihood likelihood(Call *call)
{
    PyObject *given = next(call);
    enum { TERMS_GIVEN = 9 };
    double values[TERMS_GIVEN] = {0};
    demand(call, given == NULL || (PyTuple_Check(given) && PyTuple_Size(given) == TERMS_GIVEN),
           "not a tuple of nine numbers");
    for (Py_ssize_t i = 0; !call->failed && i < TERMS_GIVEN; i++) {
        values[i] = PyFloat_AsDouble(PyTuple_GetItem(given, i));
        call->failed = values[i] == -1.0 && PyErr_Occurred() != NULL;
    }
    demand(call, given == NULL || (values[7] >= 0.0 && values[7] <= 1.0), "not a share");
    return (Likelihood){values[0], values[1], values[2], values[3], values[4],
                        values[5], values[6], values[7], values[8]};
}

Places places(Call *call)
{
    Py_ssize_t where_shape[2] = {2, -1}, shape[2] = {VALUES, -1};
    const int64_t *where = array(call, 'l', READ, 2, where_shape);
    shape[1] = where_shape[1];
    const double *values = array(call, 'd', READ, 2, shape);
    demand(call, shape[1] >= 1, "no place");
    if (call->failed)
        return (Places){0};
    return (Places){shape[1], where, where + shape[1], values};
}

Atlas atlas(Call *call)
{
    Py_ssize_t roads[1] = {-1}, grid[1] = {-1}, plane_shape[2] = {PLANE, -1};
    const int64_t *start = array(call, 'l', READ, 1, roads);
    const int64_t *size = array(call, 'l', READ, 1, roads);
    const int64_t *segment = array(call, 'l', READ, 1, grid);
    const double *step_m = array(call, 'd', READ, 1, roads);
    plane_shape[1] = grid[0];
    const double *plane = array(call, 'd', READ, 2, plane_shape);
    Py_ssize_t edges[1] = {-1}, firsts[1] = {call->failed ? -1 : roads[0] + 1};
    const double *edge_m = array(call, 'd', READ, 1, edges);
    const int64_t *first_edge = array(call, 'l', READ, 1, firsts);
    return (Atlas){roads[0], grid[0], edges[0], start, size, segment, step_m, plane, edge_m, first_edge};
}

PyObject *release(Call *call, PyObject *result)
{
    for (int i = 0; i < call->held; i++)
        PyBuffer_Release(call->views + i);
    while (call->listed > 0)
        free(call->lists[--call->listed]);
    if (!call->failed)
        return result;
    Py_XDECREF(result);
    return NULL;
}
