/* The runtime of the compiled cycle: memory for small temporary arrays, and functions for exceptions that never occur.
 *
 * numba keeps temporary arrays in reference-counted blocks. Here they come from a fixed buffer of the calling thread and
 * are released at the end of a call at the latest: no heap, no lock. With HEAP they come from the heap: for the kernels
 * in wheels, which also plan whole paths.
 */
#include <assert.h>
#include <stdalign.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#define ROOM 65536 /* bytes; a test checks that the largest call needs less than a fifth */

static _Atomic int64_t faults;

int64_t slip_vic_faults(void) { return atomic_load(&faults); }

static void *fault(void) {
  atomic_fetch_add(&faults, 1);
  return NULL;
}

/* numba/core/runtime/nrt.cpp has these fields in this order; of the last ones and `end` compiled code knows nothing. */
typedef struct MemInfo {
  size_t references;
  void (*end)(void *, size_t, void *);
  struct MemInfo *below;
  void *data;
  size_t size;
  size_t began;
} MemInfo;

#ifdef HEAP
enum { HEAD = 64 }; /* bytes before the numbers, which end with the MemInfo */
static_assert(sizeof(MemInfo) <= HEAD, "room for a MemInfo");

MemInfo *NRT_MemInfo_alloc_aligned(size_t size, uint32_t align) {
  if (align > HEAD || size > SIZE_MAX / 2) return fault();
  unsigned char *head = aligned_alloc(HEAD, HEAD + (size + HEAD - 1) / HEAD * HEAD);
  if (head == NULL) return fault();
  MemInfo *info = (MemInfo *)(void *)(head + HEAD) - 1;
  *info = (MemInfo){1, NULL, NULL, head + HEAD, size, 0};
  return info;
}

void NRT_MemInfo_call_dtor(MemInfo *info) { free((unsigned char *)(info + 1) - HEAD); }
#else
static _Thread_local alignas(64) unsigned char room[ROOM];
static _Thread_local size_t used, most;
static _Thread_local MemInfo *top;

MemInfo *NRT_MemInfo_alloc_aligned(size_t size, uint32_t align) {
  size_t step = align > alignof(max_align_t) ? align : alignof(max_align_t);
  size_t begin = (used + sizeof(MemInfo) + step - 1) / step * step;
  if (step > 64 || size > ROOM || begin + size > ROOM) return fault();
  MemInfo *info = (MemInfo *)(void *)(room + begin - sizeof(MemInfo));
  *info = (MemInfo){1, NULL, top, room + begin, size, used};
  used = (begin + size + alignof(max_align_t) - 1) / alignof(max_align_t) * alignof(max_align_t);
  top = info;
  if (used > most) most = used;
  return info;
}

void NRT_MemInfo_call_dtor(MemInfo *info) {
  info->references = 0;
  for (; top != NULL && top->references == 0; top = top->below) used = top->began;
}

int64_t slip_vic_room_used(void) { return (int64_t)most; }
#endif

MemInfo *NRT_MemInfo_alloc(size_t size) { return NRT_MemInfo_alloc_aligned(size, alignof(max_align_t)); }

/* Copies of a slice whose place overlaps with where it is assigned to. */
void *NRT_Allocate(size_t size) {
  MemInfo *info = NRT_MemInfo_alloc(size);
  return info == NULL ? NULL : info->data;
}

void NRT_Free(void *block) { NRT_MemInfo_call_dtor((MemInfo *)block - 1); }

/* Of exceptions, which no call raises. */
void *PyExc_RuntimeError, *PyExc_StopIteration, *PyExc_SystemError;
void *PyBytes_FromStringAndSize(void) { return fault(); }
void PyErr_Clear(void) { fault(); }
void PyErr_SetNone(void) { fault(); }
void PyErr_SetString(void) { fault(); }
void PyErr_WriteUnraisable(void) { fault(); }
int64_t PyObject_Hash(void) { fault(); return 0; }
void *PyTuple_Pack(void) { return fault(); }
void *PyUnicode_FromKindAndData(void) { return fault(); }
void *PyUnicode_FromString(void) { return fault(); }
void Py_DecRef(void *object) { (void)object; }
int numba_do_raise(void) { fault(); return 0; }
int numba_gil_ensure(void) { fault(); return 0; }
void numba_gil_release(void) {}
void *numba_runtime_build_excinfo_struct(void) { return fault(); }
void *numba_unpickle(void) { return fault(); }

/* Of views of contiguous arrays by rows, the only ones there are. */
int numba_attempt_nocopy_reshape(
    ptrdiff_t nd, const ptrdiff_t *dims, const ptrdiff_t *strides, ptrdiff_t newnd, const ptrdiff_t *newdims,
    ptrdiff_t *newstrides, ptrdiff_t itemsize, int is_f_order) {
  (void)nd, (void)dims, (void)strides;
  if (is_f_order) return fault() != NULL;
  for (ptrdiff_t i = newnd - 1, stride = itemsize; i >= 0; stride *= newdims[i--]) newstrides[i] = stride;
  return 1;
}
