/* Kernels as Python functions, which check their arguments as numba does: a wrong one is a TypeError.
 *
 * wheel.py writes kernels.h, with a line for each kernel:
 *   KERNEL(number, name, arguments, result, types, values)
 * arguments: four characters each, INT_, REAL, BOOL, or for an array f (float64) or i (int64), the number of its
 * dimensions, C (by rows) or F (by columns), and w if it is written to, else r.
 */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>
#include <stdint.h>
#include <string.h>

int64_t slip_vic_faults(void);

typedef struct {
  union {
    void *p;
    int64_t i;
    double r;
  };
  int64_t n, m;
} Value;

static int take_array(const char *kind, PyObject *given, Value *value) {
  Py_buffer view;
  int order = kind[2] == 'F' ? PyBUF_F_CONTIGUOUS : PyBUF_C_CONTIGUOUS;
  if (PyObject_GetBuffer(given, &view, order | PyBUF_FORMAT | (kind[3] == 'w' ? PyBUF_WRITABLE : 0)) != 0) return 0;
  const char *format = view.format == NULL ? "" : view.format;
  int of_kind = kind[0] == 'f' ? strcmp(format, "d") == 0 : strcmp(format, "l") == 0 || strcmp(format, "q") == 0;
  int fits = of_kind && view.itemsize == 8 && view.ndim == kind[1] - '0' && (uintptr_t)view.buf % 8 == 0;
  if (fits) *value = (Value){{view.buf}, view.shape[0], view.ndim > 1 ? view.shape[1] : 1};
  PyBuffer_Release(&view); /* the caller keeps the array alive, and the GIL keeps it unchanged */
  return fits;
}

static int take_number(const char *kind, PyObject *given, Value *value) {
  if (kind[0] == 'R' && PyFloat_Check(given)) {
    value->r = PyFloat_AsDouble(given);
    return 1;
  }
  if (kind[0] == 'B') { /* a bool of Python or of numpy */
    Py_buffer view;
    if (PyBool_Check(given)) {
      value->i = given == Py_True;
      return 1;
    }
    if (PyObject_GetBuffer(given, &view, PyBUF_FORMAT) != 0) return 0;
    int fits = view.ndim == 0 && strcmp(view.format, "?") == 0;
    if (fits) value->i = *(unsigned char *)view.buf != 0;
    PyBuffer_Release(&view);
    return fits;
  }
  PyObject *whole = PyNumber_Index(given);
  if (whole == NULL) return 0;
  if (kind[0] == 'R')
    value->r = PyLong_AsDouble(whole);
  else
    value->i = PyLong_AsLongLong(whole);
  Py_DECREF(whole);
  return PyErr_Occurred() == NULL;
}

static int refuse(const char *name, const char *kind, Py_ssize_t at, PyObject *given) {
  PyErr_Clear();
  PyObject *type = (PyObject *)Py_TYPE(given), *format = PyObject_GetAttrString(given, "dtype"), *shape = NULL;
  if (format != NULL) shape = PyObject_GetAttrString(given, "shape");
  PyErr_Clear();
  if (kind[2] != 'C' && kind[2] != 'F')
    PyErr_Format(PyExc_TypeError, "%s: argument %zd: got %R, expected %.4s", name, at, type, kind);
  else
    PyErr_Format(
        PyExc_TypeError, "%s: argument %zd: got %R %S %S, expected a contiguous%s array of %s, %c-dimensional, by %s", name,
        at, type, format ? format : Py_None, shape ? shape : Py_None, kind[3] == 'w' ? ", writable" : "",
        kind[0] == 'f' ? "float64" : "int64", kind[1], kind[2] == 'C' ? "rows" : "columns");
  Py_XDECREF(format);
  Py_XDECREF(shape);
  return 0;
}

static int take(const char *name, const char *kinds, PyObject *const *given, Py_ssize_t count, Value *values) {
  Py_ssize_t wanted = (Py_ssize_t)strlen(kinds) / 4;
  if (count != wanted) {
    PyErr_Format(PyExc_TypeError, "%s: got %zd arguments, expected %zd", name, count, wanted);
    return 0;
  }
  for (Py_ssize_t k = 0; k < count; k++) {
    const char *kind = kinds + 4 * k;
    int array = kind[2] == 'C' || kind[2] == 'F';
    if (!(array ? take_array : take_number)(kind, given[k], values + k)) return refuse(name, kind, k + 1, given[k]);
  }
  return 1;
}

static PyObject *give(const char *name, PyObject *result) {
  static int64_t seen;
  if (slip_vic_faults() == seen) return result;
  seen = slip_vic_faults();
  Py_XDECREF(result);
  return PyErr_Format(PyExc_RuntimeError, "%s: out of memory, or an exception in compiled code", name);
}

typedef void C_none;
typedef double C_float64;
typedef int64_t C_int64, C_bool;
#define GIVE_none(call) (call, Py_NewRef(Py_None))
#define GIVE_float64(call) PyFloat_FromDouble(call)
#define GIVE_int64(call) PyLong_FromLongLong(call)
#define GIVE_bool(call) PyBool_FromLong((long)(call))

#define KERNEL(number, name, kinds, result, types, values) \
  C_##result kernel_##number types; \
  static PyObject *call_##number(PyObject *module, PyObject *const *given, Py_ssize_t count) { \
    Value a[sizeof(kinds) / 4]; \
    (void)module; \
    return take(name, kinds, given, count, a) ? give(name, GIVE_##result(kernel_##number values)) : NULL; \
  }
#include "kernels.h"
#undef KERNEL

#define KERNEL(number, name, kinds, result, types, values) \
  {name, (PyCFunction)(void (*)(void))call_##number, METH_FASTCALL, NULL},
static PyMethodDef methods[] = {
#include "kernels.h"
    {NULL, NULL, 0, NULL}};
static PyModuleDef_Slot slots[] = {{0, NULL}};
static PyModuleDef definition = {PyModuleDef_HEAD_INIT, "kernels", NULL, 0, methods, slots, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_kernels(void) { return PyModuleDef_Init(&definition); }
