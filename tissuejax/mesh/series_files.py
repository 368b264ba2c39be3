"""Vectors and points over time from a lab's files: CSV of columns, C3D, TRC, frames of image correlation. SI out."""

import glob
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError, unknown
from tissuejax.recordings.checks import increasing
from tissuejax.recordings.exports.export import UNSEEN, Exported, by_description, from_text, recognised
from tissuejax.recordings.exports.meanings import bare, quantity_of, split_unit
from tissuejax.recordings.exports.tracked import Tracked, marker_export
from tissuejax.recordings.places import resolve
from tissuejax.units import factor, quantity

SERIES_KEYS = (
    "file",
    "columns",
    "time",
    "unit",
    "time_unit",
    "sign",
    "noise",
    "rate",
    "every",
    "scale",
    "z",
    "registration",
)


@dataclass(frozen=True)
class Series:
    """Values over time, SI.

    Attributes:
        time, values: s, and in the unit wanted.
        noise: as the side file tells it, or None.
        said: sentences on what the reader took for granted.
        on_support: whether the points are plane and nobody said how high: they lie at z = 0.
    """

    time: Float[np.ndarray, " n"]
    values: Float[np.ndarray, "n ..."]
    noise: str | None
    said: tuple[str, ...] = ()
    on_support: bool = False


def vector_over_time(spec: object, side: Path, what: str, si: str) -> Series:
    """Three components over time, from a table.

    Args:
        spec: the side file's table: `file`, and what its columns are if their names don't tell.
        side: the side file.
        what: "probe" or "force".
        si: unit wanted.

    Raises:
        InputError: a key or column that isn't there, a unit that isn't stated, times that don't increase.
    """
    spec = _checked(spec, what)
    path = resolve(str(spec["file"]), side)
    content = _content(path)
    letters = [f"f{a}" for a in "xyz"] if what == "force" else list("xyz")
    names = _named(spec["columns"], content, path) if "columns" in spec else _three(content, letters, path, what)
    values = _si(content, names, spec, si, what, path) * _sign(spec, what)
    time = _time(content, spec, path, len(values))
    return Series(time, values, _text(spec, "noise"))


def points_over_time(spec: object, side: Path) -> Series:
    """Points over time, NaN where one was lost: a file of motion capture, frames of image correlation, or a table.

    Raises:
        InputError: as `vector_over_time`; frames with different points.
    """
    spec = _checked(spec, "markers")
    files = spec["file"] if isinstance(spec["file"], list) else [spec["file"]]
    paths = [p for f in files for p in _found(str(f), side)]
    kind = marker_export(paths[0])
    said: list[str] = []
    plane = False
    if kind is None:
        content = _content(paths[0])
        names, count = _triples(content, spec, paths[0])
        values = _si(content, names, spec, "m", "markers", paths[0]).reshape(-1, count, 3)
        time = _time(content, spec, paths[0], len(values))
    else:
        tracked = [kind.read(p) for p in paths]
        plane = tracked[0].plane
        said += [f"{kind.program}: {UNSEEN}"] if by_description(kind.basis) else []
        said += tracked[0].assumed
        position, time, remarks = _frames(tracked, spec, paths)
        said += remarks
        unit = str(spec.get("unit", tracked[0].unit))
        values = position * _scale(unit, spec, paths[0])
    if "z" in spec and not plane:
        raise InputError("markers.z: found a height for points in space, expected one for a plane view: leave z out")
    step = int(spec.get("every", 1))
    if step < 1:
        raise InputError(f"markers.every: found {step}, expected a whole number from 1")
    values = values[:, ::step] * _sign(spec, "markers")
    if "z" in spec:
        values = values + [0.0, 0.0, quantity(spec["z"], "m", "markers.z")]
        said.append(f"the view is plane, its points are put at z = {spec['z']}")
    return Series(time, values, _text(spec, "noise"), tuple(said), plane and "z" not in spec)


def _checked(spec: object, what: str) -> Mapping[str, Any]:
    if isinstance(spec, str):
        spec = {"file": spec}
    if not isinstance(spec, dict) or "file" not in spec:
        raise InputError(f'{what}: found {spec!r}, expected {{ file = "{what}.csv" }}')
    for key in spec:
        if key not in SERIES_KEYS:
            raise unknown(f"key in {what}", key, SERIES_KEYS)
    return spec


def _found(text: str, side: Path) -> list[Path]:
    if any(c in text for c in "*?["):
        paths = sorted(Path(p) for p in glob.glob(str(side.parent / text)))
        if not paths:
            raise InputError(f"markers.file: found no file {text} beside {side}")
        return paths
    return [resolve(text, side)]


def _content(path: Path) -> Exported:
    kind = recognised(path)
    return kind.read(path) if kind else from_text(path)


def _bare_names(content: Exported) -> dict[str, str]:
    return {bare(split_unit(n)[0]): n for n in content.columns.cells}


def _named(wanted: object, content: Exported, path: Path) -> list[str]:
    if not isinstance(wanted, list) or len(wanted) % 3 or not wanted:
        raise InputError(f"{path}: columns: found {wanted!r}, expected three names for each vector")
    plain = _bare_names(content)
    found = []
    for name in map(str, wanted):
        known = name if name in content.columns.cells else plain.get(bare(name))
        if known is None:
            raise InputError(f"{path}: {unknown('column', name, content.columns.cells)}")
        found.append(known)
    return found


def _three(content: Exported, letters: Sequence[str], path: Path, what: str) -> list[str]:
    """The columns whose name is, or ends with, the three letters."""
    plain = _bare_names(content)
    for make in (lambda a: [a], lambda a: [n for n in plain if n.split()[-1] == a]):
        found = [next((n for n in make(a) if n in plain), "") for a in letters]
        if all(found):
            return [plain[n] for n in found]
    if what == "force":
        return _three(content, list("xyz"), path, "force's")
    there = ", ".join(content.columns.cells)
    raise InputError(
        f"{path}: found columns {there}, expected {', '.join(letters)}; say which: columns = [...] ({what})"
    )


def _triples(content: Exported, spec: Mapping[str, Any], path: Path) -> tuple[list[str], int]:
    """All columns that come in x, y, z, in the order of the file, and how many points they make."""
    if "columns" in spec:
        names = _named(spec["columns"], content, path)
        return names, len(names) // 3
    plain = _bare_names(content)
    heads = list(dict.fromkeys(n[:-1].rstrip() for n in plain if n[-1:] in "xyz" and n[:-1].strip()))
    made = [[plain.get(f"{h} {a}", plain.get(f"{h}{a}", "")) for a in "xyz"] for h in heads]
    names = [n for triple in made if all(triple) for n in triple]
    if not names:
        there = ", ".join(list(content.columns.cells)[:12])
        raise InputError(f"{path}: found columns {there}, expected time and m1_x, m1_y, m1_z, m2_x, ...")
    return names, len(names) // 3


def _si(
    content: Exported, names: Sequence[str], spec: Mapping[str, Any], si: str, what: str, path: Path
) -> Float[np.ndarray, "n c"]:
    units = [str(spec.get("unit", "")) or content.units.get(n, "") for n in names]
    if not all(units):
        raise InputError(f'{path}: no unit of {what} in its names; say it: unit = "{"mm" if si == "m" else si}"')
    return np.stack([content.columns.numbers(n) * factor(u, si) for n, u in zip(names, units)], axis=1)


def _time(content: Exported, spec: Mapping[str, Any], path: Path, n: int) -> Float[np.ndarray, " n"]:
    if "rate" in spec:
        return np.arange(n) / _rate(spec)
    name = str(spec.get("time", "")) or next(
        (c for c in content.columns.cells if quantity_of(split_unit(c)[0]) == "time"), ""
    )
    if not name:
        raise InputError(f'{path}: found no column of time; say which (time = "...") or give rate = "10 Hz"')
    unit = str(spec.get("time_unit", "")) or content.units.get(name, "") or "s"
    time = content.columns.numbers(name) * factor(unit, "s")
    increasing(time, path, f"column {name!r}")
    return time


def _rate(spec: Mapping[str, Any]) -> float:
    rate = quantity(spec["rate"], "Hz", "rate")
    if not rate > 0:
        raise InputError(f"rate: found {spec['rate']!r}, expected frames a second, above zero")
    return rate


def _frames(
    tracked: Sequence[Tracked], spec: Mapping[str, Any], paths: Sequence[Path]
) -> tuple[Float[np.ndarray, "m k 3"], Float[np.ndarray, " m"], list[str]]:
    """One file with its times, or the deformed states of one file a frame, behind the reference; and what to say.

    Where the first file is the reference itself, its displacements zero, it is the first frame.
    """
    first = tracked[0]
    if len(tracked) == 1 and first.time is not None:
        return first.position, first.time, []
    if "rate" not in spec:
        raise InputError(f'{paths[0]}: holds no time; give the frames a second, rate = "5 Hz"')
    rate = _rate(spec)
    added = (
        f"the reference is the frame at 0 s, and the first file's state that at {1 / rate:.4g} s"
        if np.nan_to_num(first.position[-1] - first.position[0]).any()
        else "the first file is the reference, the frame at 0 s"
    )
    if len(tracked) == 1:
        said = f"the file's first frame (the reference) is at 0 s, its second at {1 / rate:.4g} s"
        return first.position, np.arange(len(first.position)) / rate, [said]
    keys = [tuple(p) for p in np.round(first.position[0], 6)]
    frames = [] if added.startswith("the first") else [first.position[0]]
    for path, one in zip(paths, tracked):
        at = {tuple(p): q for p, q in zip(np.round(one.position[0], 6), one.position[-1])}
        frames.append(np.array([at.get(k, np.full(3, np.nan)) for k in keys]))
        if not np.isfinite(frames[-1]).any():
            raise InputError(f"{path}: shares no point with {paths[0]}: all frames must have one reference")
    return np.stack(frames), np.arange(len(frames)) / rate, [added]


def _scale(unit: str, spec: Mapping[str, Any], path: Path) -> float:
    if "scale" in spec:
        return quantity(spec["scale"], "m", "markers.scale")
    if unit in ("", "pixel"):
        raise InputError(f'{path}: lengths are pixels or without unit; say how long one is: scale = "0.05 mm"')
    return factor(unit, "m")


def _sign(spec: Mapping[str, Any], what: str) -> float:
    sign = spec.get("sign", 1)
    if sign not in (1, -1):
        raise InputError(f"{what}.sign: found {sign!r}, expected 1 or -1")
    return float(sign)


def _text(spec: Mapping[str, Any], key: str) -> str | None:
    return str(spec[key]) if key in spec else None
