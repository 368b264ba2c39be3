"""A worker ends with the process that it works for, be that killed and the worker in the middle of a case."""

import multiprocessing
import os
import threading
from concurrent.futures import ProcessPoolExecutor


def pool(workers: int) -> ProcessPoolExecutor:
    """So many spawned processes, as JAX does not survive a fork; they end with this one, which calls them.

    Where there are several each computes on one thread, whatever its libraries would take: the work is shared out
    already. What the environment says (`OMP_NUM_THREADS`, `XLA_FLAGS`) goes before.
    """
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_begun, initargs=(workers > 1,))


def leave_with_parent() -> None:
    """From now on this process, begun by `multiprocessing`, ends as soon as its parent is gone.

    A pool's worker would finish its case and then wait for the next one for ever, holding cores and memory. What is
    watched is a pipe that every system closes for a process that was killed; by a thread, as the worker may be busy.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()


def _begun(one_thread: bool) -> None:
    leave_with_parent()
    if one_thread:  # before JAX starts
        os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")
        os.environ.setdefault("OMP_NUM_THREADS", "1")
