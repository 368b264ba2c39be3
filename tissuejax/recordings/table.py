"""A lab's own tables (CSV, TSV, semicolons, spaces; plain or gzip), described by a small TOML side file: no code.

    file       = "tests.csv"             # beside this side file; "shared:recordings/x.csv" for the shared folder
    sample     = "{animal}"              # a name, or {column}: one sample for each value
    recording  = "{test_id}"             # a name, or {column}: one recording for each value
    experiment = "uniaxial"              # uniaxial, planar, equibiaxial, biaxial, simple-shear, probing, cutting
    positive   = "compression"           # which loads and shortenings the table counts positive ("tension" if absent)
    [columns]
    time         = { column = "time_s", unit = "s", zero = true }
    displacement = { column = "crosshead", unit = "mm", zero = true }
    force        = { column = "load", unit = "N" }
    [specimen]
    height   = "30 mm"
    diameter = "50 mm"
    [noise]
    force = "0.02 N"                     # or { column = "sd", unit = "N" }, or "estimate" (as if absent)

`[columns]` holds `time` (without it samples are taken as 1 s apart; dates and times of day are seconds from the first
one), one of `stretch`, `strain` (engineering),
`true_strain`, `radial_stretch`, `length`, `displacement`, `shear`, `angle`, and one of `nominal_stress`, `true_stress`
(Cauchy), `force`. A column is `{ column, unit, sign = -1, zero = true }`; `zero = 5` takes the mean of the first five
samples as zero; `column` may be a place from 1. A biaxial test gives lists of two columns. `[specimen]`: `height`,
`diameter`, `area`, or `width` and `thickness`; `frozen_height` and `frozen_diameter` give the area that a specimen has
after thawing (and `settling = true` refers stretch to the frozen height); `radius` of a probing tip; each a text with
unit or a column; `file` and `key` look them up in a second table. `[where]` keeps rows: `mode = "UT"`,
`mode = ["UT", "PS"]`, `time_s = ">= 2"`. Also: `every = 4` (each fourth sample), `missing = "drop"` (rows with empty
cells), `relative_to_first = true` (stretch from the first sample's length), `lowpass = "5 Hz"`, `[attributes]` (numbers
that go with a recording), `separator`, `decimal`, `comment`, `skip`, `header`, `source`, `notes`, `density`. Several
kinds of tests in one side file: a `[[part]]` for each, with the keys that differ. A cut says what else it needs in
`[tissue]` and `[blade]`, see `cutting_table`.
"""

import functools
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tissuejax.errors import InputError, unknown
from tissuejax.recordings import checks
from tissuejax.recordings.cutting_table import body
from tissuejax.recordings.delimited import Columns, load
from tissuejax.recordings.exports.export import export_named
from tissuejax.recordings.format import Format
from tissuejax.recordings.places import resolve
from tissuejax.recordings.recording import Sample
from tissuejax.recordings.side_file import Column, Part, SideFile, parse
from tissuejax.recordings.specimens import Considered, considered, recording_from
from tissuejax.units import factor


@dataclass(frozen=True)
class Group:
    """The rows of a table that make one recording."""

    part: Part
    columns: Columns
    rows: np.ndarray


class Table(Format):
    """Tables of columns with a TOML side file: one or many samples."""

    name = "table with a TOML side file"
    endings = (".toml", ".csv", ".tsv", ".txt", ".dat", ".csv.gz")

    def recognises(self, path: Path, head: bytes) -> bool:
        """By the ending; a table itself is recognised too, to say that it needs a side file."""
        return path.name.lower().endswith(self.endings)

    def names(self, path: Path) -> list[str]:
        """The samples that the side file's templates make of the table."""
        return list(_groups(_side(path)))

    def read(self, path: Path, name: str) -> Sample:
        """One sample: only its own rows are converted and checked."""
        side = _side(path)
        groups = _groups(side)
        if name not in groups:
            raise InputError(f"{path}: {unknown('sample', name, groups)}")
        return _sample(side, name, groups[name])


def read_table(side: str | os.PathLike) -> dict[str, Sample]:
    """Every sample that a side file describes, by name, in the order in which the table names them.

    Raises:
        InputError: the side file, the table, the line and column, what was found and what was expected.
    """
    table = Table()
    return {name: table.read(Path(side), name) for name in table.names(Path(side))}


def selections(side: str | os.PathLike, name: str) -> list[Considered]:
    """Which rows of a sample's tests are kept, for the recordings whose part cuts them (cycles, preload, ...).

    Raises:
        InputError: as reading does.
    """
    parsed = _side(Path(side))
    found = []
    for key, group in _groups(parsed)[name].items():
        if group.part.selection:
            place = f"{group.columns.path}: sample {name!r}, recording {key!r}"
            sizes = {k: _size(parsed, group, k, v, place) for k, v in group.part.specimen.items()}
            found.append(considered(group.part, group.columns, group.rows, sizes, key, place))
    return found


def _side(path: Path) -> SideFile:
    if path.suffix.lower() == ".toml":
        return _parsed(path, path.stat().st_mtime_ns)
    beside = path.with_name(re.sub(r"\.[a-z]+(\.gz)?$", "", path.name, flags=re.I) + ".toml")
    if beside.is_file():
        return _parsed(beside, beside.stat().st_mtime_ns)
    raise InputError(
        f"{path}: found a table without a side file, expected {beside.name} beside it, saying what its columns hold: "
        f"`tissuejax import {path}` looks at the table and writes one"
    )


@functools.lru_cache(maxsize=8)
def _parsed(path: Path, changed: int) -> SideFile:
    return parse(path)


@functools.lru_cache(maxsize=8)
def _loaded(path: Path, changed: int, reading: tuple) -> Columns:
    options = dict(reading)
    kind = options.pop("format", None)
    if kind is None:
        return load(path, **options)
    if options:
        raise InputError(
            f"{path}: format = {kind!r} says how the file is laid out: "
            f"leave {', '.join(options)} out, or leave format out"
        )
    return export_named(kind).read(path).columns


def _columns_of(part: Part, file: str, side: SideFile) -> Columns:
    path = resolve(file, side.path)
    return _loaded(path, path.stat().st_mtime_ns, tuple(part.reading.items()))


def _groups(side: SideFile) -> dict[str, dict[str, Group]]:
    """Rows by sample and recording name, in order of first appearance."""
    marks = [resolve(p.file, side.path) for p in side.parts]
    return _grouped(side.path, side.path.stat().st_mtime_ns, tuple((m, m.stat().st_mtime_ns) for m in marks))


@functools.lru_cache(maxsize=4)
def _grouped(path: Path, changed: int, tables: tuple) -> dict[str, dict[str, Group]]:
    side = _parsed(path, changed)
    found: dict[str, dict[str, Group]] = {}
    for part in side.parts:
        columns = _columns_of(part, part.file, side)
        rows = np.flatnonzero(_where(part, columns))
        if not len(rows):
            raise InputError(
                f"{path}: where = {dict(part.where)} keeps no row of {columns.path}; check names and values"
            )
        keys = np.stack([_labels(part.sample, columns)[rows], _labels(part.recording, columns)[rows]])
        pairs, first, which = np.unique(keys.astype(str), axis=1, return_index=True, return_inverse=True)
        ends = np.cumsum(np.bincount(which.ravel()))[:-1]
        own = np.split(rows[np.argsort(which.ravel(), kind="stable")], ends)  # of each pair, in file order
        for k in np.argsort(first):
            sample, recording = (str(x).replace("/", "-").strip() for x in pairs[:, k])
            mine = found.setdefault(sample, {})
            if recording in mine:
                raise InputError(
                    f"{path}: two parts make recording {recording!r} of sample {sample!r}; "
                    'give each part its own, e.g. recording = "tension" and recording = "shear"'
                )
            mine[recording] = Group(part, columns, own[k])
    return found


def _labels(template: str, columns: Columns) -> np.ndarray:
    """The name that a template gives to each row."""
    pieces = re.split(r"\{([^{}]*)\}", template)
    made = np.full(len(columns.lines), pieces[0], dtype=object)
    for column, text in zip(pieces[1::2], pieces[2::2]):
        made = made + columns.text(column).astype(str) + text
    return made


def _where(part: Part, columns: Columns) -> np.ndarray:
    keep = np.ones(len(columns.lines), bool)
    for name, wanted in part.where.items():
        any_of = [_matches(columns, name, w) for w in (wanted if isinstance(wanted, list) else [wanted])]
        keep &= np.any(any_of, axis=0)
    return keep


_COMPARE = {">=": np.greater_equal, "<=": np.less_equal, "!=": np.not_equal, ">": np.greater, "<": np.less}


def _matches(columns: Columns, name: str, wanted: object) -> np.ndarray:
    if isinstance(wanted, int | float) and not isinstance(wanted, bool):
        return columns.numbers(name) == wanted
    found = re.fullmatch(r"(>=|<=|!=|>|<)\s*([-+.\deE]+)", str(wanted))
    if found:
        return _COMPARE[found[1]](columns.numbers(name), float(found[2]))
    return columns.text(name) == str(wanted)


def _sample(side: SideFile, name: str, groups: Mapping[str, Group]) -> Sample:
    recordings, notes = {}, [side.notes] if side.notes else []
    for key, group in groups.items():
        place = f"{group.columns.path}: sample {name!r}, recording {key!r}"
        sizes = {k: _size(side, group, k, v, place) for k, v in group.part.specimen.items()}
        recordings[key], said = recording_from(group.part, group.columns, group.rows, sizes, key, place, side.path)
        notes += [n for n in said if n not in notes]
    checks.distinct((f"{side.path}: {key}", recording) for key, recording in recordings.items())
    bodies = {tuple(g.part.cut.tissue.items()): g.part.cut for g in groups.values() if g.part.cut is not None}
    if len(bodies) > 1:
        raise InputError(f"{side.path}: sample {name!r} has {len(bodies)} sizes of [tissue]; give each its own sample")
    geometry = body(next(iter(bodies.values()))) if bodies else None
    return Sample(name, recordings, geometry, side.density, None, side.source, " ".join(notes))


def _size(side: SideFile, group: Group, name: str, size: float | Column, place: str) -> float:
    """A specimen size in SI: as said in the side file, from the table itself, or looked up in the second table."""
    if not isinstance(size, Column):
        return size
    columns, rows, lookup = group.columns, group.rows, group.part.lookup
    if lookup is not None:
        key = columns.text(lookup.key)[rows[0]]
        columns = _columns_of(group.part, lookup.file, side)
        rows = np.flatnonzero(columns.text(lookup.key) == key)
        if len(rows) != 1:
            raise InputError(
                f"{columns.path}: found {len(rows)} rows with {lookup.key} = {key!r}, expected one ({place})"
            )
    values = columns.numbers(size.column)[rows] * factor(size.unit, "m^2" if name == "area" else "m")
    if not (values == values[0]).all() or not values[0] > 0:
        found = f"{values[0]:g} to {values[-1]:g}"
        raise checks.refusal(place, f"{name} from column {size.column!r}", found, "one size above zero")
    return float(values[0])
