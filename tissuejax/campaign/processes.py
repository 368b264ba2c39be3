"""Processes of this machine. One that is killed takes its case with it; the pool is made anew and goes on."""

from concurrent.futures import FIRST_COMPLETED, wait
from concurrent.futures.process import BrokenProcessPool
from typing import ClassVar

from tissuejax.campaign.engine import Engine, Report, work
from tissuejax.campaign.store import Store
from tissuejax.campaign.task import Task
from tissuejax.parent import pool

AHEAD = 4  # tasks handed out per worker, so that none waits for the client


class Processes(Engine):
    """A pool of spawned processes."""

    name: ClassVar[str] = "processes"

    def run(self, store: Store, tasks: list[Task], workers: int, report: Report, where: str | None = None) -> None:
        """See `Engine.run`."""
        left = list(reversed(tasks))
        while left:
            broken = self._pool(store, left, workers, report)
            if not broken:
                return
            left = [task for task in left if store.row(task.key) is None and store.begun(task.key) <= RETRIES]

    def _pool(self, store: Store, left: list[Task], workers: int, report: Report) -> bool:
        """Work until `left` is empty or a worker dies; what was not finished is put back."""
        with pool(workers) as crew:
            out = {}
            while left or out:
                try:
                    while left and len(out) < AHEAD * workers:
                        task = left.pop()
                        out[crew.submit(work, str(store.folder), task.plain())] = task
                    done, _ = wait(out, return_when=FIRST_COMPLETED)
                    for future in done:
                        task = out[future]
                        report(future.result())
                        del out[future]
                except BrokenProcessPool:
                    left.extend(out.values())
                    return True
        return False


RETRIES = 2  # times a case is begun again within one run after its worker died
