"""How XLA calls a loop written in C, and how a long one is shared among threads.

A loop of `SHARED` elements or more has a fixed number of parts, each with sums of its own that are added in order: the
result is the same to the last bit whoever computed which. XLA's pool is asked to help, and parts are taken as threads
come free: the caller takes what no one has begun, so that a pool that is busy costs nothing but the asking. Where
the caller waited for a helper longer than it worked itself (cores that others use), it works alone for `PATIENCE` times
as long: waits in vain are a fiftieth of a run at most.
Nothing is shared under OMP_NUM_THREADS=1 or XLA_FLAGS=--xla_cpu_multi_thread_eigen=false, as both were when a loop first
ran, nor on one core.
"""

from collections.abc import Sequence
from string import Template

SHARED = 4096  # elements from which a loop is shared: below, to wake a thread costs too much of what it gives
PARTS = 2
PATIENCE = 50


def parts(elements: int) -> int:
    """In how many parts so many elements are taken, by their number alone."""
    return PARTS if elements >= SHARED else 1


def handler(inputs: int, outputs: int, sizes: Sequence[str], nodes: str, batch: str, width: int) -> str:
    """The C that XLA calls, to stand after `run`.

    Args:
        inputs: arguments with the cells.
        outputs: results; one more is given where there are parts, room for their sums: (parts - 1, numbers).
        sizes: C of how many numbers of each result are summed; 0 where each element has its own.
        nodes, batch: C of the sizes N and B.
        width: elements of a block.
    """
    given = {"inputs": inputs, "outputs": outputs, "nodes": nodes, "batch": batch, "width": width}
    summed = "".join(f"  size[{i}] = {size};\n" for i, size in enumerate(sizes))
    return HANDLER.substitute(given, sizes=summed, patience=PATIENCE)


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
enum { INPUTS = $inputs, OUTPUTS = $outputs, WIDTH = $width };

typedef struct {
  const void *in[INPUTS];
  void *out[OUTPUTS];
  real *spare;
  int64_t E, N, B, parts, next, done, held;
} Work;

int64_t helped = 0; /* parts that another thread than the caller's computed */
static double alone = 0; /* until when no help is asked for, s */

static int64_t sizes(const Work *w, int64_t *size) {
  const int64_t N = w->N, B = w->B;
  int64_t all = 0;
$sizes  for (int i = 0; i < OUTPUTS; i++) all += size[i];
  return all;
}

static void part(const Work *w, int64_t p) {
  int64_t size[OUTPUTS], at = (p - 1) * sizes(w, size);
  void *out[OUTPUTS];
  for (int i = 0; i < OUTPUTS; i++) {
    out[i] = p && size[i] ? w->spare + at : w->out[i];
    at += size[i];
  }
  const int64_t blocks = w->E / WIDTH, begin = blocks * p / w->parts * WIDTH;
  const int64_t end = p + 1 == w->parts ? w->E : blocks * (p + 1) / w->parts * WIDTH;
  run(w->in, out, w->E, w->N, w->B, begin, end);
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
  int64_t size[OUTPUTS];
  const int64_t all = sizes(w, size);
  for (int64_t p = 1; p < w->parts; p++) {
    const real *from = w->spare + (p - 1) * all;
    for (int i = 0; i < OUTPUTS; from += size[i++]) {
      real *to = w->out[i];
      for (int64_t j = 0; j < size[i]; j++) to[j] += from[j];
    }
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
