"""Run the diagnosis over a challenge: case by case, resumable, in parallel, without ever looking at the sealed keys."""

import os
import shutil
import time
import traceback
from concurrent.futures import as_completed
from pathlib import Path

from tissuejax.challenge import files
from tissuejax.errors import InputError
from tissuejax.parent import pool
from tissuejax.progress import Progress, Silent
from tissuejax.storage import write_json


def run(
    folder: str | os.PathLike,
    jobs: int = 1,
    only: tuple[str, ...] = (),
    again: bool = False,
    progress: Progress | None = None,
) -> dict[str, Path]:
    """Diagnose every case that has no result yet; returns the results by case name.

    A case whose diagnosis fails gets a result too, with the verdict "failed" and the message, so that failures are
    graded and not forgotten.

    Args:
        folder: a challenge made by `make`.
        jobs: processes; each keeps its compiled programs from case to case.
        only: names of cases; all by default.
        again: diagnose cases that have a result anew.

    Raises:
        InputError: no challenge there, a case that isn't in it, or a case file that was changed since it was made.
    """
    folder = Path(folder)
    manifest = files.read_manifest(folder)
    entries = {e["name"]: e for e in manifest["cases"]}
    if missing := [name for name in only if name not in entries]:
        raise InputError(f"no case {', '.join(missing)} in {folder}; it has {min(entries)} to {max(entries)}")
    names = list(only) or sorted(entries)
    for name in names:
        path = folder / "cases" / f"{name}.h5"
        if not path.exists() or files.sha256(path) != entries[name]["sha256"]:
            raise InputError(f"{path} is missing or not the file that was made; make the challenge again by its seed")
    results = {name: folder / "results" / name / "result.json" for name in names}
    left = [name for name in names if again or not results[name].exists()]
    with (progress or Silent()).stage(f"diagnosing {len(left)} cases", total=len(left)) as stage:
        for name in _each(folder, [(name, entries[name]["energy"]) for name in left], jobs):
            stage.advance(note=name)
    return results


def _each(folder: Path, cases: list[tuple[str, str]], jobs: int):
    if jobs == 1:
        for name, energy in cases:
            yield answer(folder, name, energy)
        return
    with pool(jobs) as crew:
        for done in as_completed([crew.submit(answer, folder, name, energy) for name, energy in cases]):
            yield done.result()


def answer(folder: Path, name: str, energy: str) -> str:
    """Diagnose one case into DIR/results/NAME, whole or not at all; returns its name."""
    final = folder / "results" / name
    partial = folder / "results" / f".{name}.partial"
    partial.mkdir(parents=True, exist_ok=True)  # a stopped case of minutes goes on from the simulations it left there
    began = time.perf_counter()
    try:
        diagnosed(folder / "cases" / f"{name}.h5", energy, partial)
    except Exception as error:  # a failure of the diagnosis is an answer to be graded
        write_json(
            partial / "result.json",
            {
                "verdict": "failed",
                "effects": [],
                "error": f"{type(error).__name__}: {error}",
                "trace": traceback.format_exc(),
            },
        )
    write_json(partial / "cost.json", {"seconds": time.perf_counter() - began})
    shutil.rmtree(partial / "runs", ignore_errors=True)
    shutil.rmtree(final, ignore_errors=True)
    partial.rename(final)
    return name


def diagnosed(path: Path, energy: str, out: Path) -> None:
    """The one place where the challenge calls the diagnosis: leaves `out`/result.json.

    Where a recording was kept back, what the repaired model says of it is left in `out`/kept.json.
    """
    import jax

    from tissuejax.challenge.kept import foretold
    from tissuejax.diagnosis.diagnose import diagnose

    jax.config.update("jax_enable_x64", True)
    found = diagnose(path, energy=energy, out=out)
    if not (out / "result.json").exists():
        raise FileNotFoundError(f"the diagnosis left no result.json in {out}")
    kept = path.parents[1] / "kept" / path.name
    if kept.exists():
        try:
            said = {"nominal_stress": foretold(found, path, energy, kept).tolist()}
        except Exception as error:  # the verdict stands without it
            said = {"nominal_stress": [], "error": f"{type(error).__name__}: {error}"}
        write_json(out / "kept.json", said)
