"""The folder of a campaign: its tasks, one result file a case, and marks of the cases under way.

    campaign.json          settings and tasks
    results/ab/abcd....json    one row each, written aside and renamed
    running/abcd....        the case being worked on, with the number of times it was begun

A case that dies with its worker leaves its mark; after `retries` more tries it is a failure like another.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tissuejax.campaign.task import Task, answer
from tissuejax.errors import InputError
from tissuejax.storage import write_json, write_text

PLAN = "campaign.json"


class Store:
    """See the module."""

    def __init__(self, folder: str | Path):
        self.folder = Path(folder)

    def plan(self, tasks: list[Task], retries: int) -> None:
        """Write the tasks down; results of an earlier plan that still count stay."""
        write_json(self.folder / PLAN, {"retries": retries, "tasks": [t.plain() for t in tasks]})

    def planned(self) -> tuple[list[Task], int]:
        """The tasks and the number of retries.

        Raises:
            InputError: no campaign in the folder.
        """
        try:
            plan = json.loads((self.folder / PLAN).read_text())
            return [Task.of(t) for t in plan["tasks"]], int(plan["retries"])
        except FileNotFoundError as error:
            raise InputError(f"{self.folder}: no campaign here; begin one with `campaign run`") from error
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{self.folder}: no campaign here ({error}); begin one with `campaign run`") from error

    def path(self, key: str) -> Path:
        """Where the row of a key lies."""
        return self.folder / "results" / key[:2] / f"{key}.json"

    def row(self, key: str) -> dict[str, Any] | None:
        """The row of a key, None if there is none that can be read."""
        try:
            return json.loads(self.path(key).read_text())
        except (OSError, ValueError):
            return None

    def missing(self, tasks: list[Task], retries: int, failed: bool = False) -> list[Task]:
        """Tasks without a row (with `failed`, also those that failed); those begun too often become failures now."""
        found = []
        for task in tasks:
            row = self.row(task.key)
            if row is not None and not (failed and row["status"] == "failed"):
                continue
            if row is None and self.begun(task.key) > retries:
                self.fail(task, f"its worker died {self.begun(task.key)} times (killed, or out of memory)")
                continue
            found.append(task)
        return found

    def begun(self, key: str) -> int:
        """How many times a case without a row was begun."""
        try:
            return int((self.folder / "running" / key).read_text() or 0)
        except (OSError, ValueError):
            return 0

    def work(self, task: Task) -> dict[str, Any]:
        """Answer a task and keep its row; called in the worker, so that a client that dies loses nothing finished."""
        mark = self.folder / "running" / task.key
        write_text(mark, str(self.begun(task.key) + 1))
        row = answer(task)
        self._keep(task, row)
        mark.unlink(missing_ok=True)
        return _brief(row)

    def fail(self, task: Task, reason: str) -> dict[str, Any]:
        """Keep a failure for a task whose process had to be ended."""
        row = {"sample": task.sample, "file": task.file, "status": "failed", "reason": reason}
        self._keep(task, row)
        (self.folder / "running" / task.key).unlink(missing_ok=True)
        return _brief(row)

    def rows(self, tasks: list[Task]) -> Iterator[tuple[Task, dict[str, Any] | None]]:
        """Every task with its row."""
        for task in tasks:
            yield task, self.row(task.key)

    def _keep(self, task: Task, row: dict[str, Any]) -> None:
        write_json(self.path(task.key), row)


def _brief(row: dict[str, Any]) -> dict[str, Any]:
    return {name: row.get(name) for name in ("sample", "status", "reason", "seconds")}
