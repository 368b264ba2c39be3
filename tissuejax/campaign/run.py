"""Begin, go on with, and look at a campaign."""

import os
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tissuejax import campaign as package
from tissuejax.campaign.engine import Engine
from tissuejax.campaign.store import Store
from tissuejax.campaign.task import Settings, Task, again, tasks
from tissuejax.families import lookup, members
from tissuejax.progress import Progress, Silent

UNJUDGED = {"not judged": ["an earlier version fitted it and did not judge it; give the command of `run` again"]}


def engines() -> dict[str, type[Engine]]:
    """All engines by name."""
    return members(package, Engine)


def begin(folder: Path, files: list[str], settings: Settings, limit: float = 0.0, retries: int = 1) -> Store:
    """Write the plan of a campaign into a folder; answers already there for the same key stay."""
    store = Store(folder)
    store.plan(tasks([os.path.abspath(f) if "#" not in f else f for f in files], settings, limit), retries)
    return store


def go_on(
    folder: Path, engine: str = "serial", workers: int = 2, where: str | None = None, failed: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Do what is missing, and only that.

    Args:
        engine: "serial", "processes" or "dask".
        failed: do failed cases again too; files that could not be read are looked at again.

    Returns:
        The counts of `status`, and "ran", "seconds", "per_second" of this run.
    """
    store = Store(folder)
    planned, retries = store.planned()
    if failed and any(task.unread for task in planned):
        planned = [new for task in planned for new in (again(task) if task.unread else [task])]
        store.plan(planned, retries)
    todo = store.missing(planned, retries, failed)
    for task in todo:
        if failed:
            store.path(task.key).unlink(missing_ok=True)
    begun, kind = time.perf_counter(), lookup("engine", engine, engines())()
    before = len(planned) - len(todo)
    with (progress or Silent()).stage(f"cases ({before} done before)" if before else "cases", len(todo)) as stage:
        kind.run(store, todo, workers, lambda row: stage.advance(note=str(row["sample"])), where)
    seconds = time.perf_counter() - begun
    return status(folder) | {"ran": len(todo), "seconds": seconds, "per_second": len(todo) / max(seconds, 1e-9)}


def status(folder: Path) -> dict[str, Any]:
    """How many cases are done, failed, missing; failures with their reasons.

    Of those done, "suspect" should not be used as they are ("suspect_kinds": for what) and "usable" may be.
    """
    store = Store(folder)
    planned, _ = store.planned()
    counts: dict[str, Any] = {"cases": len(planned), "done": 0, "failed": 0, "missing": 0, "suspect": 0}
    counts |= {"suspect_kinds": {}, "failures": {}}
    for name, (task, row) in zip(labels(planned), store.rows(planned), strict=True):
        if row is None:
            counts["missing"] += 1
        else:
            counts[row["status"]] += 1
            if row["status"] == "failed":
                counts["failures"][name] = row["reason"]
            elif kinds := doubts(task, row):
                counts["suspect"] += 1
                for kind in kinds:
                    counts["suspect_kinds"][kind] = counts["suspect_kinds"].get(kind, 0) + 1
    return counts | {"usable": counts["done"] - counts["suspect"]}


def fits(folder: Path) -> dict[str, dict[str, Any]]:
    """Records of the finished fits by specimen, with what makes them suspect; the same data are one specimen."""
    store = Store(folder)
    planned, _ = store.planned()
    found = {}
    for name, (task, row) in zip(labels(planned), store.rows(planned), strict=True):
        if row and row["status"] == "done" and "correlation" in row["answer"]:
            found.setdefault(task.key, (name, row["answer"] | {"suspect": doubts(task, row)}))
    return dict(found.values())


def labels(planned: Sequence[Task]) -> list[str]:
    """The name of each case's sample; of samples of one name in several files also the file, as far as it differs."""
    seen = Counter(task.sample for task in planned)
    root = os.path.commonpath([os.path.dirname(os.path.abspath(task.file)) for task in planned]) if planned else ""
    return [
        t.sample if seen[t.sample] == 1 else f"{t.sample} of {os.path.relpath(os.path.abspath(t.file), root)}"
        for t in planned
    ]


def doubts(task: Task, row: dict[str, Any]) -> dict[str, list[str]]:
    """Why a finished fit should not be used as it is, by kind; empty where it may be, and for a diagnosis."""
    if row["status"] != "done" or task.settings.kind != "fit":
        return {}
    return row["answer"].get("suspect", UNJUDGED)


def headline(counts: dict[str, Any]) -> str:
    """The counts of `status` in a line."""
    kinds = ", ".join(f"{kind} {n}" for kind, n in sorted(counts["suspect_kinds"].items(), key=lambda of: -of[1]))
    unfit = f", {counts['suspect']} of them not to be used as they are ({kinds})" if counts["suspect"] else ""
    cases = f"{counts['cases']} case{'s' * (counts['cases'] != 1)}"
    return f"{cases}: {counts['done']} done{unfit}, {counts['failed']} failed, {counts['missing']} missing"


def units(folder: Path) -> dict[str, str]:
    """Units of the parameters in the table, from the first fit that gave an answer."""
    store = Store(folder)
    for _, row in store.rows(store.planned()[0]):
        if row is not None and row["status"] == "done" and "parameters" in row["answer"]:
            return {path: p["unit"] for path, p in row["answer"]["parameters"].items() if p.get("unit", "1") != "1"}
    return {}


def table(folder: Path) -> list[dict[str, Any]]:
    """One row a case: sample, status, what makes it suspect, chi-square, parameters with their errors; for a diagnosis
    the verdict."""
    store, found = Store(folder), []
    planned, _ = store.planned()
    for name, (task, row) in zip(labels(planned), store.rows(planned), strict=True):
        line: dict[str, Any] = {"sample": name, "status": "missing" if row is None else row["status"]}
        if row is not None and row["status"] == "failed":
            line["reason"] = row["reason"]
        elif row is not None and task.settings.kind == "fit":
            a = row["answer"]
            unfit = "; ".join(why for of_kind in doubts(task, row).values() for why in of_kind)
            line |= {"fit": a["status"], "suspect": unfit, "chi2_per_dof": a["chi2_per_dof"]}
            for path, p in a["parameters"].items():
                if p["free"]:
                    line |= {path: p["value"], f"std {path}": p["std"]}
        elif row is not None:
            verdict = row["answer"].get("verdict", {})
            line |= {"verdict": verdict.get("kind") if isinstance(verdict, dict) else verdict}
            line["missing physics"] = " ".join(verdict.get("missing", ())) if isinstance(verdict, dict) else ""
        found.append(line)
    return found
