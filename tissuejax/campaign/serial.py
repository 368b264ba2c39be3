"""One case after the other, in this process."""

from typing import ClassVar

from tissuejax.campaign.engine import Engine, Report
from tissuejax.campaign.store import Store
from tissuejax.campaign.task import Task


class Serial(Engine):
    """The reference: every other engine gives the same answers."""

    name: ClassVar[str] = "serial"

    def run(self, store: Store, tasks: list[Task], workers: int, report: Report, where: str | None = None) -> None:
        """See `Engine.run`."""
        for task in tasks:
            report(store.work(task))
