"""A case in a process of its own, for engines whose workers run cases in a thread, where no alarm rings.

The child answers one case after the other. It keeps the limit itself, by an alarm in its main thread; a case that does
not listen (inside compiled code) is killed `GRACE` seconds later with its process, and is a failure.
"""

import multiprocessing
import threading
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.process import BaseProcess
from typing import Any, NamedTuple, Protocol

from tissuejax.parent import leave_with_parent

GRACE = 30.0  # s beyond the limit until a case that does not stop is killed

Work = Callable[[str, dict[str, Any]], dict[str, Any]]


class Pipe(Protocol):
    """One end of a pipe, of the kind that the system has."""

    def send(self, obj: Any, /) -> None:
        """Pickle it to the other end."""

    def recv(self) -> Any:
        """What the other end sent next; waits for it."""

    def poll(self, timeout: float | None = 0.0) -> bool:
        """Whether something can be received within so many seconds."""
        ...

    def close(self) -> None:
        """No more is sent or received."""


class Running(NamedTuple):
    """A process that answers, and the pipe to it."""

    process: BaseProcess
    pipe: Pipe


class Child:
    """One spawned process; a new one is begun where the last was killed.

    Attributes:
        work: what it does with (folder, task); a function of a module.
        running: the process; None before the first case and where the last was killed.
    """

    def __init__(self, work: Work):
        self.work = work
        self.running: Running | None = None
        self.busy = threading.Lock()

    def answer(self, folder: str, task: dict[str, Any], limit: float, grace: float = GRACE) -> dict[str, Any] | None:
        """What the work gives, or None where it had to be killed or died."""
        with self.busy:
            if self.running is None or not self.running.process.is_alive():
                self.running = _begun(self.work)
            pipe = self.running.pipe
            try:
                pipe.send((folder, task))
                if pipe.poll(limit + grace):
                    return pipe.recv()
            except (EOFError, OSError):
                pass
            self.end()
            return None

    def end(self) -> None:
        """Kill the process."""
        if self.running is not None:
            self.running.process.kill()
            self.running.process.join()
            self.running.pipe.close()
            self.running = None


def _begun(work: Work) -> Running:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, work), daemon=True)
    process.start()
    theirs.close()
    return Running(process, ours)


def _serve(pipe: Pipe, work: Work) -> None:
    """Answer until the parent is gone."""
    leave_with_parent()
    with suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            pipe.send(work(*pipe.recv()))
