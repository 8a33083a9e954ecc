/* Python's arguments as checked C values. */
#ifndef ROADPRINT_ARRAYS_H
#define ROADPRINT_ARRAYS_H

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include "kernels.h"

enum { MOST_ARRAYS = 12, MOST_LISTS = 2 };

/* The arguments of one call and the arrays held for it; `release` gives them back. */
typedef struct {
    PyObject *const *arguments;
    Py_ssize_t next;
    Py_buffer views[MOST_ARRAYS];
    int held;
    int failed; /* a Python error is set; later arguments are not looked at */
    ptrdiff_t *lists[MOST_LISTS];
    int listed;
} Call;

typedef enum { READ, WRITE } Use;

/* False, with TypeError set, unless there are `wanted` arguments. */
int begin(Call *call, PyObject *const *arguments, Py_ssize_t given, Py_ssize_t wanted);

/* The next argument as a C-contiguous array of dtype 'd', 'f' or 'l' (64 bits) and this shape;
 * a shape of -1 is any and is filled in. NULL when it is not. */
void *array(Call *call, char type, Use use, int dimensions, Py_ssize_t shape[]);
double number(Call *call);
ptrdiff_t whole(Call *call);
/* The next argument as a list of whole numbers, each under `end`; its length in `count`. */
const ptrdiff_t *whole_list(Call *call, ptrdiff_t end, Py_ssize_t *count);

Told told(Call *call);             /* block, samples, numbers */
Along along(Call *call, char row); /* 'r': rows, or 'b': bend */
Tape tape_of(Call *call);          /* blocks, outside */
Likelihood likelihood(Call *call); /* a tuple of nine floats */
Places places(Call *call);         /* where, values */
Atlas atlas(Call *call);           /* start, size, segment, step_m, plane, edge_m, first_edge */

/* Sets ValueError unless `holds`. */
void demand(Call *call, int holds, const char *what);
/* Sets the error of a kernel's answer, if it is one. */
void check(Call *call, ptrdiff_t answer);
/* Gives all arrays back; `result` unless the call failed. */
PyObject *release(Call *call, PyObject *result);

#endif
