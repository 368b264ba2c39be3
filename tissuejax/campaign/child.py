"""A case in a process of its own, for engines whose workers run cases in a thread, where no alarm rings.

The child answers one case after the other. It keeps the limit itself, by an alarm in its main thread; a case that does
not listen (inside compiled code) is killed `GRACE` seconds later with its process, and is a failure.
"""

import multiprocessing
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

GRACE = 30.0  # s beyond the limit until a case that does not stop is killed

Work = Callable[[str, dict[str, Any]], dict[str, Any]]


class Child:
    """One spawned process; a new one is begun where the last was killed.

    Attributes:
        work: what it does with (folder, task); a function of a module.
    """

    def __init__(self, work: Work):
        self.work, self.process, self.pipe = work, None, None
        self.busy = threading.Lock()

    def answer(self, folder: str, task: dict[str, Any], limit: float, grace: float = GRACE) -> dict[str, Any] | None:
        """What the work gives, or None where it had to be killed or died."""
        with self.busy:
            if self.process is None or not self.process.is_alive():
                self._begin()
            try:
                self.pipe.send((folder, task))
                if self.pipe.poll(limit + grace):
                    return self.pipe.recv()
            except (EOFError, OSError):
                pass
            self.end()
            return None

    def end(self) -> None:
        """Kill the process."""
        if self.process is not None:
            self.process.kill()
            self.process.join()
            self.pipe.close()
            self.process = None

    def _begin(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, self.work), daemon=True)
        self.process.start()
        theirs.close()


def _serve(pipe, work: Work) -> None:
    """Answer until the parent is gone."""
    with suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            pipe.send(work(*pipe.recv()))
