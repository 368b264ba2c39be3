"""How XLA calls a loop written in C, and how a long one is shared among threads.

A loop of `SHARED` elements or more has a fixed number of parts, each with sums of its own that are added in order: the
result is the same to the last bit whoever computed which. XLA's pool is asked to help, and parts are taken as threads
come free: the caller takes what no one has begun, so that a pool that is busy costs nothing but the asking. Where
the caller waited for a helper longer than it worked itself (cores that others use), it works alone for `PATIENCE` times
as long: waits in vain are a fiftieth of a run at most.
Nothing is shared under OMP_NUM_THREADS=1 or XLA_FLAGS=--xla_cpu_multi_thread_eigen=false (what a loop found when it
first ran), nor on one core.
"""

from collections.abc import Sequence
from string import Template

SHARED = 4096  # elements from which a loop is shared: below, to wake a thread costs too much of what it gives
PARTS = 2
PATIENCE = 50


def parts(elements: int) -> int:
    """In how many parts so many elements are taken, by their number alone."""
    return PARTS if elements >= SHARED else 1


def handler(inputs: int, outputs: Sequence[tuple[str, int]], nodes: str, batch: str, corners: int, width: int) -> str:
    """The C that XLA calls, to stand after `run`.

    Args:
        inputs: arguments with the cells.
        outputs: kind and rows of each result (`write.Slot`); one more is given where there are parts, room for their
            sums: (parts - 1, numbers).
        nodes, batch: C of the sizes N and B.
        corners: nodes of an element.
        width: elements of a block.
    """
    given = {"inputs": inputs, "outputs": len(outputs), "nodes": nodes, "batch": batch, "corners": corners}
    length = {"nodal": "N", "uniform": "1", "lane": "0"}
    sizes = "".join(
        f"  rows[{i}] = {f'B * {rows}' if kind != 'lane' else 0}, length[{i}] = {length[kind]};\n"
        for i, (kind, rows) in enumerate(outputs)
    )
    return HANDLER.substitute(given, sizes=sizes, width=width, parts=PARTS, patience=PATIENCE)


HANDLER = Template("""
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifdef __x86_64__
#define PAUSE __builtin_ia32_pause()
#else
#define PAUSE ((void)0)
#endif
enum { INPUTS = $inputs, OUTPUTS = $outputs, CORNERS = $corners, WIDTH = $width, PARTS = $parts };

typedef struct {
  const void *in[INPUTS];
  void *out[OUTPUTS];
  real *spare;
  int64_t E, N, B, parts, next, done, held, low[PARTS], high[PARTS];
} Work;

int64_t helped = 0; /* parts that another thread than the caller's computed */
static double alone = 0; /* until when no help is asked for, s */

/* Of the sums: rows of how many numbers (0 rows where each element has its own). */
static void sizes(const Work *w, int64_t *rows, int64_t *length) {
  const int64_t N = w->N, B = w->B;
$sizes}

static void part(Work *w, int64_t p) {
  int64_t rows[OUTPUTS], length[OUTPUTS], room = 0, low = 0, high = w->N;
  sizes(w, rows, length);
  for (int i = 0; i < OUTPUTS; i++) room += rows[i] * length[i];
  const int64_t blocks = w->E / WIDTH, begin = blocks * p / w->parts * WIDTH;
  const int64_t end = p + 1 == w->parts ? w->E : blocks * (p + 1) / w->parts * WIDTH;
  if (p) { /* elements that stand together have nodes that do: the others' sums are left alone */
    const int32_t *cells = w->in[0];
    int32_t least = INT32_MAX, most = -1;
    for (int64_t a = 0; a < CORNERS; a++)
#pragma omp simd reduction(min : least) reduction(max : most)
      for (int64_t e = a * w->E + begin; e < a * w->E + end; e++) {
        least = cells[e] < least ? cells[e] : least;
        most = cells[e] > most ? cells[e] : most;
      }
    low = least, high = (int64_t)most + 1;
  }
  void *out[OUTPUTS];
  real *own = p ? w->spare + (p - 1) * room : NULL;
  for (int i = 0; i < OUTPUTS; i++) {
    out[i] = p && rows[i] ? own : w->out[i];
    const int64_t from = length[i] > 1 ? low : 0, to = length[i] > 1 ? high : length[i];
    for (int64_t r = 0; r < rows[i]; r++) memset((real *)out[i] + r * length[i] + from, 0, (to - from) * sizeof(real));
    if (p) own += rows[i] * length[i];
  }
  run(w->in, out, w->E, w->N, w->B, begin, end);
  w->low[p] = low, w->high[p] = high;
}

static int64_t taken(Work *w) {
  int64_t count = 0, p;
  while ((p = __atomic_fetch_add(&w->next, 1, __ATOMIC_RELAXED)) < w->parts) {
    part(w, p);
    __atomic_fetch_add(&w->done, 1, __ATOMIC_RELEASE);
    count++;
  }
  return count;
}

static void added(const Work *w) {
  int64_t rows[OUTPUTS], length[OUTPUTS];
  sizes(w, rows, length);
  const real *from = w->spare;
  for (int64_t p = 1; p < w->parts; p++)
    for (int i = 0; i < OUTPUTS; i++) {
      real *to = w->out[i];
      const int64_t begin = length[i] > 1 ? w->low[p] : 0, end = length[i] > 1 ? w->high[p] : length[i];
      for (int64_t r = 0; r < rows[i]; r++, to += length[i], from += length[i])
        for (int64_t j = begin; j < end; j++) to[j] += from[j];
    }
}

static void left(Work *w) {
  if (__atomic_sub_fetch(&w->held, 1, __ATOMIC_ACQ_REL) == 0) free(w);
}

static void help(void *data) {
  __atomic_fetch_add(&helped, taken(data), __ATOMIC_RELAXED);
  left(data);
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int failed(const XLA_FFI_Api *api, XLA_FFI_Error *error) {
  if (!error) return 0;
  XLA_FFI_Error_Destroy_Args args = {sizeof args, NULL, error};
  api->XLA_FFI_Error_Destroy(&args);
  return 1;
}

/* Threads of XLA's pool that may help. */
static int64_t helpers(XLA_FFI_CallFrame *frame) {
  static int one = -1;
  if (one < 0) {
    const char *threads = getenv("OMP_NUM_THREADS"), *flags = getenv("XLA_FLAGS");
    one = (threads && atoi(threads) == 1) || (flags && strstr(flags, "xla_cpu_multi_thread_eigen=false"));
  }
  double until;
  __atomic_load(&alone, &until, __ATOMIC_RELAXED);
  if (one || now() < until) return 0;
  int64_t threads = 0;
  XLA_FFI_ThreadPool_NumThreads_Args args = {sizeof args, NULL, frame->ctx, &threads};
  return failed(frame->api, frame->api->XLA_FFI_ThreadPool_NumThreads(&args)) ? 0 : threads - 1;
}

static void shared(XLA_FFI_CallFrame *frame, Work *w) {
  int64_t asked = helpers(frame);
  if (asked > w->parts - 1) asked = w->parts - 1;
  w->held = 1;
  for (; asked > 0; asked--) {
    XLA_FFI_ThreadPool_Schedule_Args args = {sizeof args, NULL, frame->ctx, help, w};
    __atomic_fetch_add(&w->held, 1, __ATOMIC_RELAXED);
    if (failed(frame->api, frame->api->XLA_FFI_ThreadPool_Schedule(&args))) {
      __atomic_fetch_sub(&w->held, 1, __ATOMIC_RELAXED);
      break;
    }
  }
  const double begun = now();
  taken(w);
  const double worked = now();
  for (int64_t tries = 0; __atomic_load_n(&w->done, __ATOMIC_ACQUIRE) < w->parts; tries++)
    if (tries < 1000) PAUSE; else sched_yield();
  const double came = now(), until = came + $patience * (came - worked);
  if (came - worked > worked - begun) __atomic_store(&alone, &until, __ATOMIC_RELAXED);
  added(w);
  left(w);
}

static XLA_FFI_Buffer *buffer(void *p) { return (XLA_FFI_Buffer *)p; }

/* What XLA calls. */
XLA_FFI_Error *handler(XLA_FFI_CallFrame *frame) {
  if (frame->extension_start && frame->extension_start->type == XLA_FFI_Extension_Metadata) {
    XLA_FFI_Metadata *told = ((XLA_FFI_Metadata_Extension *)frame->extension_start)->metadata;
    told->api_version.major_version = XLA_FFI_API_MAJOR;
    told->api_version.minor_version = XLA_FFI_API_MINOR;
    return NULL;
  }
  Work w = {0}, *copy;
  for (int i = 0; i < INPUTS; i++) w.in[i] = buffer(frame->args.args[i])->data;
  for (int i = 0; i < OUTPUTS; i++) w.out[i] = buffer(frame->rets.rets[i])->data;
  const XLA_FFI_Buffer *cells = buffer(frame->args.args[0]), *spare;
  w.E = cells->dims[cells->rank - 1], w.N = $nodes, w.B = $batch, w.parts = 1;
  if (frame->rets.size > OUTPUTS) {
    spare = buffer(frame->rets.rets[OUTPUTS]);
    w.spare = spare->data, w.parts = 1 + spare->dims[0];
  }
  if (w.parts > 1 && (copy = malloc(sizeof w))) {
    *copy = w;
    shared(frame, copy);
  } else {
    taken(&w);
    added(&w);
  }
  return NULL;
}
""")
