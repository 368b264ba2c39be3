"""Programs on a second core: helper processes that are asked over a pipe.

Threads would be lighter, but two programs at once in one process wait for each other for ever (jax 0.10.2 on CPU, also
when each is run by the thread that asks). A worker is a bare interpreter, started when first needed and kept; it finds
compiled programs in the disk cache. Its main module is this one, so the caller's script is never run twice.
"""

import atexit
import ctypes
import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NoReturn

import jax
import jax.numpy as jnp

from tissuejax.cache import source
from tissuejax.experiments import programs

CODE = "TISSUEJAX_CODE"  # hash of the code that asks: a worker with another one does nothing for it
PATIENT = 1.0  # s, that a worker may take to end by itself
Job = tuple[Any, ...]  # function, static, arguments: as `programs.run` takes them


class Worker:
    """One helper process."""

    def __init__(self):
        root = str(Path(__file__).resolve().parents[2])
        path = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH", "")]))
        flags = os.environ.get("XLA_FLAGS", "")
        if "xla_cpu_multi_thread_eigen" not in flags:
            flags = f"{flags} --xla_cpu_multi_thread_eigen=false".strip()
        double = "1" if jnp.result_type(float) == jnp.float64 else "0"
        environment = os.environ | {
            "PYTHONPATH": path,
            "XLA_FLAGS": flags,
            "JAX_ENABLE_X64": double,
            "JAX_PLATFORMS": "cpu",
            CODE: source.LOADED,
        }
        process = subprocess.Popen(
            [sys.executable, "-m", "tissuejax.experiments.workers"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment,
        )  # fmt: skip
        assert process.stdin is not None  # a pipe, as it was asked for
        assert process.stdout is not None
        self.process, self.jobs, self.answers = process, process.stdin, process.stdout
        atexit.register(self.close)

    def ask(self, job: Job, do: Callable) -> Any:
        """The result of one job; an exception of the job is raised here."""
        pickle.dump((do, jax.device_get(job)), self.jobs)
        self.jobs.flush()
        fine, answer = pickle.load(self.answers)
        if not fine:
            raise answer
        return answer

    def close(self) -> None:
        """End the process, also in the middle of a job (a compilation can't be interrupted)."""
        if self.process.poll() is None:
            with suppress(BrokenPipeError):
                self.jobs.close()
            try:
                self.process.wait(timeout=PATIENT)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()


_workers: list[Worker] = []


def close_all() -> None:
    """End all helper processes."""
    for worker in _workers:
        worker.close()


def trim() -> None:
    """Give memory that is free but held (a compilation leaves 0.2 GiB of it) back to the system, where C can."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def release() -> None:
    """End the helpers, which idle, and give their memory back; the next `run_all` starts new ones."""
    while _workers:
        _workers.pop().close()
    trim()


def run_all(jobs: Sequence[Job], processes: int, do: Callable = programs.run) -> list:
    """Results of all jobs in order, on the host; this process takes them from the front, each worker from the back.

    What ends it in the middle (Ctrl-C, an error here) ends the helpers that are at work: a late answer of one would be
    taken for that of the next job.

    Args:
        jobs: (function, static, *arguments); the function has to be importable.
        processes: this one included.
        do: what is done with a job, `programs.run` or `programs.compiled`.
    """
    waiting, results = deque(range(len(jobs))), [None] * len(jobs)
    failures: list[BaseException] = []

    def serve(worker: Worker) -> None:
        while True:
            try:
                i = waiting.pop()
            except IndexError:
                return
            try:
                results[i] = worker.ask(jobs[i], do)
            except (EOFError, BrokenPipeError, pickle.PickleError):  # a lost worker: its job is done here
                waiting.appendleft(i)
                _drop(worker)
                return
            except Exception as error:
                failures.append(error)
                return

    count = min(processes, len(jobs)) - 1
    while len(_workers) < count:
        _workers.append(Worker())
    helpers = _workers[: max(count, 0)]
    threads = [threading.Thread(target=serve, args=(w,), daemon=True) for w in helpers]
    for thread in threads:
        thread.start()
    try:
        while True:
            while waiting:
                try:
                    i = waiting.popleft()
                except IndexError:
                    break
                results[i] = jax.device_get(do(*jobs[i]))
            for thread in threads:
                thread.join()
            if failures:
                raise failures[0]
            if not waiting:
                return results
    except BaseException:
        waiting.clear()
        for worker, thread in zip(helpers, threads, strict=True):
            if thread.is_alive():
                _drop(worker)
        raise


def _drop(worker: Worker) -> None:
    """End a helper that will not answer any more."""
    with suppress(ValueError):
        _workers.remove(worker)
    worker.process.kill()


def serve_pipe() -> None:
    """The worker's side: jobs from standard input, results to standard output; prints go to the error stream.

    Ctrl-C reaches it too, and is the caller's business: what ends a worker is the end of its input, which also comes
    when the caller is killed, be a job under way or not.
    """
    from tissuejax.cache.programs import keep_programs

    if os.environ.get(CODE, source.LOADED) != source.LOADED:
        sys.exit("tissuejax was changed since the calculation began: its simulations go on in one process")
    keep_programs()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    waiting: SimpleQueue[tuple[Callable, Job]] = SimpleQueue()
    threading.Thread(target=_listen, args=(waiting,), daemon=True).start()
    while True:
        do, job = waiting.get()
        try:
            reply = (True, jax.device_get(do(*job)))
        except Exception as error:
            reply = (False, error)
        pickle.dump(reply, answers)
        answers.flush()


def _listen(waiting: SimpleQueue) -> NoReturn:
    """Take in jobs; at their end leave at once."""
    try:
        while True:
            waiting.put(pickle.load(sys.stdin.buffer))
    except EOFError:
        os._exit(0)
    except BaseException:  # a job that can't be read: the caller sees the worker go, and does it
        traceback.print_exc()
        os._exit(1)


if __name__ == "__main__":
    serve_pipe()
