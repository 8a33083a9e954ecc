/* Python functions that take or make a list of stretches of any length. */
#ifndef ROADPRINT_UNDER_H
#define ROADPRINT_UNDER_H

#include "arrays.h"

PyObject *stretches_of_coarse(PyObject *self, PyObject *const *arguments, Py_ssize_t given);
PyObject *stretches_about_places(PyObject *self, PyObject *const *arguments, Py_ssize_t given);
PyObject *under_factors(PyObject *self, PyObject *const *arguments, Py_ssize_t given);

#endif
