"""What an engine is: it works through tasks, wherever; the store has the answers."""

import abc
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

from tissuejax.campaign.child import Child
from tissuejax.campaign.store import Store
from tissuejax.campaign.task import Task

Report = Callable[[dict[str, Any]], None]


class Engine(abc.ABC):
    """One way of working through tasks, a file each.

    Class data:
        name: as typed after --engine.
    """

    name: ClassVar[str]

    @abc.abstractmethod
    def run(self, store: Store, tasks: list[Task], workers: int, report: Report, where: str | None = None) -> None:
        """Work through the tasks; `report` is called with a short row of each. What died is left missing.

        Args:
            workers: how many at once.
            where: an address, for engines that need one.
        """


def work(folder: str, task: dict[str, Any]) -> dict[str, Any]:
    """Answer one task given as plain data; what engines send to their workers.

    Where a limit can't ring, since this is not the process's main thread, a child answers (`child`).
    """
    asked, store = Task.of(task), Store(Path(folder))
    if asked.limit <= 0 or threading.current_thread() is threading.main_thread():
        return store.work(asked)
    answer = CHILD.answer(folder, task, asked.limit)
    return store.fail(asked, f"took longer than {asked.limit:g} s and did not stop") if answer is None else answer


CHILD = Child(work)
