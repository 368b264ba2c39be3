"""Make a challenge: cases from a seed, their keys sealed, and the hash of the keys in the manifest before any run."""

import hashlib
import json
import os
from concurrent.futures import as_completed
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from tissuejax.challenge import cutting_cases, files, material_cases, rest_cases
from tissuejax.errors import InputError, unknown
from tissuejax.parent import pool
from tissuejax.progress import Progress, Silent
from tissuejax.storage import replacing, write_json

KINDS = ("material", "probing", "rest", "cutting")


def make(
    out: str | os.PathLike,
    kind: str = "material",
    count: int = 200,
    seed: int = 1,
    jobs: int = 1,
    progress: Progress | None = None,
    strong: bool = False,
    pairs: bool = False,
    commit: str | None = None,
    rest: bool = False,
    aimed: bool = False,
) -> dict:
    """Make `count` cases and return the manifest.

    A case depends on the seed and its own number alone: a folder with fewer cases of the same seed is filled up, and
    the results that it has stay valid.

    Args:
        out: folder of the challenge.
        kind: "material", "probing", "cutting" or "rest": material tests of known effects beside a rest that no
            catalogue has.
        count: number of cases.
        seed: the same seed gives the same cases; another one, others.
        jobs: processes.
        progress: told after every case.
        strong: probings with strong effects only, one or two of them: how often is right what can be seen?
        pairs: probings with two effects each, both of those that can be seen at all, at the upper end of their range.
        rest: probings with a rest in the force that no catalogue has, beside their effects or alone.
        aimed: probings at sizes where it is open whether their effects can be told, in turn (`probing_aims`).
        commit: hash of the commit that will be measured; the seed is drawn from it, so that nobody chooses it.

    Raises:
        InputError: unknown kind, strong material tests or pairs of them alone, both of these at once, a count below
            one, or a folder that holds another challenge already.
    """
    out = Path(out)
    if kind not in KINDS:
        raise unknown("kind of challenge", kind, KINDS)
    if count < 1 or jobs < 1:
        raise InputError(f"count {count}, jobs {jobs}: both must be 1 or more")
    if strong + pairs + rest + aimed > 1:
        raise InputError(
            "--strong, --pairs, --rest, --aimed: one of them at most (strong ones have pairs among them already)"
        )
    if (strong or pairs or rest or aimed) and kind != "probing":
        raise InputError(
            "--strong, --pairs, --rest, --aimed are of probings; take --kind probing, or --kind rest for material tests"
        )
    which = {"strong": strong, "pairs": pairs} | ({"rest": True} if rest else {}) | ({"aimed": True} if aimed else {})
    pinned = {} if commit is None else {"commit": commit}
    if commit is not None:
        seed = seed_of(commit, kind, which)
    plan = {"version": 1, "kind": kind, "count": count, "seed": seed} | which | pinned
    if (out / "manifest.json").exists():
        manifest = {"strong": False, "pairs": False} | files.read_manifest(out)
        if {k: manifest.get(k) for k in plan} == plan:
            return manifest
        if {k: manifest.get(k) for k in plan if k != "count"} != {k: v for k, v in plan.items() if k != "count"}:
            raise InputError(f"{out} holds another challenge already; name an empty folder, or remove that one")
        if manifest["count"] > count:
            raise InputError(f"{out} holds {manifest['count']} cases of this seed already; ask for as many or more")
    case = {
        "material": partial(_material, out, seed),
        "rest": partial(_rest, out, seed),
        "probing": partial(_probing, out, seed, which),
        "cutting": partial(_cutting, out, seed),
    }[kind]
    entries, keys = {}, {}
    with (progress or Silent()).stage(f"making {count} {kind} cases", total=count) as stage:
        for name, energy, key in _each(case, count, jobs):
            entries[name] = {"name": name, "energy": energy}
            keys[name] = key
            stage.advance(note=name)
    for name, entry in entries.items():
        entry["sha256"] = files.sha256(out / "cases" / f"{name}.h5")
    sealed = write_json(out / "sealed" / "keys.json", {name: keys[name] for name in sorted(keys)})
    manifest = plan | {"keys_sha256": files.sha256(sealed), "cases": [entries[name] for name in sorted(entries)]}
    write_json(out / "manifest.json", manifest)
    return manifest


def seed_of(commit: str, kind: str, which: dict[str, bool]) -> int:
    """The seed that belongs to a commit and a kind of challenge: the first eight digits of a hash of both.

    Raises:
        InputError: not a whole commit hash.
    """
    if len(commit) != 40 or set(commit) - set("0123456789abcdef"):
        raise InputError(f"commit {commit!r} is not a whole hash of 40 digits; take that of `git rev-parse HEAD`")
    words = [commit, kind, *(name for name, on in which.items() if on)]
    return int(hashlib.sha256(" ".join(words).encode()).hexdigest()[:8], 16)


def _each(case, count: int, jobs: int):
    if jobs == 1:
        yield from map(case, range(count))
        return
    with pool(jobs) as crew:
        for done in as_completed([crew.submit(case, i) for i in range(count)]):
            yield done.result()


def _material(out: Path, seed: int, index: int) -> tuple[str, str, dict]:
    name = f"m{index:03d}"
    case = material_cases.draw(name, seed, index)
    files.write_material(case, out / "cases" / f"{name}.h5")
    return name, case.energy, case.key


def _rest(out: Path, seed: int, index: int) -> tuple[str, str, dict]:
    name = f"s{index:03d}"
    case, kept, stress = rest_cases.draw(name, seed, index)
    files.write_material(case, out / "cases" / f"{name}.h5")
    silent = replace(case, trials=[kept], stress={kept.name: np.zeros_like(stress)}, noise=None)
    files.write_material(silent, out / "kept" / f"{name}.h5")  # what is done in it; its stress is sealed
    with replacing(out / "sealed" / "kept" / f"{name}.npy") as temporary, open(temporary, "wb") as file:
        np.save(file, stress)
    return name, case.energy, case.key


def _cutting(out: Path, seed: int, index: int) -> tuple[str, str, dict]:
    name = f"c{index:03d}"
    case = cutting_cases.draw(name, seed, index)
    cutting_cases.write(case, out / "cases" / f"{name}.h5")
    return name, "neo-hookean", case.key


def _probing(out: Path, seed: int, which: dict[str, bool], index: int) -> tuple[str, str, dict]:
    from tissuejax.challenge import probing_cases

    name = f"p{index:03d}"
    kept = out / "sealed" / "parts" / f"{name}.json"
    path = out / "cases" / f"{name}.h5"
    if not (kept.exists() and path.exists()):  # minutes each: what an interrupted run made is kept
        case = probing_cases.draw(name, seed, index, **which)
        probing_cases.write(case, path)
        write_json(kept, {"energy": case.energy, "key": case.key})
    part = json.loads(kept.read_text())
    return name, part["energy"], part["key"]
