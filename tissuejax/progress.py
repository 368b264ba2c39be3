"""Progress as an object passed in: library code advances it and never prints.

with progress.stage("fitting specimens", total=190) as stage:
    for specimen in specimens:
        ...
        stage.advance(note=specimen)
"""

import abc
import sys
from collections.abc import Iterator
from contextlib import contextmanager


class Stage(abc.ABC):
    """One counted piece of work under way."""

    @abc.abstractmethod
    def advance(self, steps: int = 1, note: str = "") -> None:
        """`steps` more are done; `note` is a word on the latest."""


class Progress(abc.ABC):
    """Where a computation reports how far it is."""

    @abc.abstractmethod
    def stage(self, description: str, total: int | None = None):
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


def for_terminal() -> Progress:
    """A bar where standard error is a terminal, silence where it is a file or a pipe."""
    return Bar() if sys.stderr.isatty() else Silent()
