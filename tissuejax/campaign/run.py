"""Begin, go on with, and look at a campaign."""

import os
import time
from pathlib import Path
from typing import Any

from tissuejax import campaign as package
from tissuejax.campaign.engine import Engine
from tissuejax.campaign.store import Store
from tissuejax.campaign.task import Settings, tasks
from tissuejax.families import lookup, members
from tissuejax.progress import Progress, Silent


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
        failed: do failed cases again too.

    Returns:
        The counts of `status`, and "ran", "seconds", "per_second" of this run.
    """
    store = Store(folder)
    planned, retries = store.planned()
    todo = store.missing(planned, retries, failed)
    for task in todo:
        if failed:
            store.path(task.key).unlink(missing_ok=True)
    begun, kind = time.perf_counter(), lookup("engine", engine, engines())()
    with (progress or Silent()).stage(f"{len(todo)} of {len(planned)} cases", len(todo)) as stage:
        kind.run(store, todo, workers, lambda row: stage.advance(note=str(row["sample"])), where)
    seconds = time.perf_counter() - begun
    return status(folder) | {"ran": len(todo), "seconds": seconds, "per_second": len(todo) / max(seconds, 1e-9)}


def status(folder: Path) -> dict[str, Any]:
    """How many cases are done, failed, missing; failures with their reasons."""
    store = Store(folder)
    planned, _ = store.planned()
    counts: dict[str, Any] = {"cases": len(planned), "done": 0, "failed": 0, "missing": 0, "failures": {}}
    for task, row in store.rows(planned):
        if row is None:
            counts["missing"] += 1
        else:
            counts[row["status"]] += 1
            if row["status"] == "failed":
                counts["failures"][task.sample] = row["reason"]
    return counts


def units(folder: Path) -> dict[str, str]:
    """Units of the parameters in the table, from the first fit that gave an answer."""
    store = Store(folder)
    for _, row in store.rows(store.planned()[0]):
        if row is not None and row["status"] == "done" and "parameters" in row["answer"]:
            return {path: p["unit"] for path, p in row["answer"]["parameters"].items() if p.get("unit", "1") != "1"}
    return {}


def table(folder: Path) -> list[dict[str, Any]]:
    """One row a case: sample, status, chi-square, parameters with their errors; for a diagnosis the verdict."""
    store, found = Store(folder), []
    for task, row in store.rows(store.planned()[0]):
        line: dict[str, Any] = {"sample": task.sample, "status": "missing" if row is None else row["status"]}
        if row is not None and row["status"] == "failed":
            line["reason"] = row["reason"]
        elif row is not None and task.settings.kind == "fit":
            a = row["answer"]
            line |= {"fit": a["status"], "chi2_per_dof": a["chi2_per_dof"]}
            for path, p in a["parameters"].items():
                if p["free"]:
                    line |= {path: p["value"], f"std {path}": p["std"]}
        elif row is not None:
            verdict = row["answer"].get("verdict", {})
            line |= {"verdict": verdict.get("kind") if isinstance(verdict, dict) else verdict}
            line["missing physics"] = " ".join(verdict.get("missing", ())) if isinstance(verdict, dict) else ""
        found.append(line)
    return found
