"""Progress as an object passed in: library code advances it and never prints.

with progress.stage("fitting specimens", total=190) as stage:
    for specimen in specimens:
        ...
        stage.advance(note=specimen)
"""

import abc
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager


class Stage(abc.ABC):
    """One counted piece of work under way."""

    @abc.abstractmethod
    def advance(self, steps: int = 1, note: str = "") -> None:
        """`steps` more are done; `note` is a word on the latest."""


class Progress(abc.ABC):
    """Where a computation reports how far it is."""

    @abc.abstractmethod
    def stage(self, description: str, total: int | None = None) -> AbstractContextManager[Stage]:
        """A context manager giving a `Stage` of `total` steps (None where the number is not known)."""


class _SilentStage(Stage):
    def advance(self, steps: int = 1, note: str = "") -> None:
        pass


class Silent(Progress):
    """Reports nothing: the default everywhere, and what tests use."""

    @contextmanager
    def stage(self, description: str, total: int | None = None) -> Iterator[Stage]:
        """A stage that ignores its steps."""
        yield _SilentStage()


class _BarStage(Stage):
    def __init__(self, bars, task):
        self._bars, self._task = bars, task

    def advance(self, steps: int = 1, note: str = "") -> None:
        self._bars.update(self._task, advance=steps, note=note)


class Bar(Progress):
    """A rich progress bar with the time left, on standard error, so that `--json` on standard output stays clean.

    Stages may be nested; each has its own line.
    """

    def __init__(self, file=None):
        from rich import progress as rich
        from rich.console import Console

        columns = (
            rich.TextColumn("{task.description}"),
            rich.BarColumn(),
            rich.MofNCompleteColumn(),
            rich.TimeElapsedColumn(),
            rich.TimeRemainingColumn(),
            rich.TextColumn("{task.fields[note]}"),
        )
        self._bars = rich.Progress(*columns, console=Console(file=file or sys.stderr))
        self._open = 0

    @contextmanager
    def stage(self, description: str, total: int | None = None) -> Iterator[Stage]:
        """A line of its own under the stages already open."""
        if self._open == 0:
            self._bars.start()
        self._open += 1
        task = self._bars.add_task(description, total=total, note="")
        try:
            yield _BarStage(self._bars, task)
        finally:
            self._open -= 1
            if self._open == 0:
                self._bars.stop()


class _LineStage(Stage):
    def __init__(self, lines, description: str, total: int | None):
        self._lines, self._description, self._total, self._done, self._note = lines, description, total, 0, ""

    def advance(self, steps: int = 1, note: str = "") -> None:
        self._done, self._note = self._done + steps, note or self._note
        self._lines.write(self)

    def __str__(self) -> str:
        of = f" {self._done} of {self._total}" if self._total else ""
        return f"{self._description}{of}: {self._note}" if self._note else f"{self._description}{of}"


class Lines(Progress):
    """A line now and then on standard error, for logs: nothing at all of what is done within seconds.

    Args:
        every: s between two lines at least, and before the first.
    """

    def __init__(self, every: float = 10.0, file=None):
        self._every, self._file = every, file
        self._begun = self._last = time.monotonic()

    @contextmanager
    def stage(self, description: str, total: int | None = None) -> Iterator[Stage]:
        """A stage that says where it is when it advances and the last line is old enough."""
        yield _LineStage(self, description, total)

    def write(self, stage: Stage) -> None:
        """Write the line of a stage if it is time for one."""
        now = time.monotonic()
        if now - self._last >= self._every:
            self._last = now
            print(f"[{now - self._begun:6.0f} s] {stage}", file=self._file or sys.stderr, flush=True)


def for_terminal() -> Progress:
    """A bar where standard error is a terminal, a line now and then where it is a file or a pipe."""
    return Bar() if sys.stderr.isatty() else Lines()
