"""What a file of unknown layout holds, guessed: format, columns, units, signs, specimen sizes; each guess is said."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tissuejax.errors import InputError
from tissuejax.recordings.clock import seconds
from tissuejax.recordings.columns_guessed import (
    Guessed,
    backwards,
    chosen_pairs,
    chosen_time,
    told,
    two_axes,
    understood,
)
from tissuejax.recordings.cutting_table import TISSUE
from tissuejax.recordings.delimited import Columns, text_lines
from tissuejax.recordings.exports import text
from tissuejax.recordings.exports.export import (
    BLOCK,
    UNSEEN,
    Exported,
    TableExport,
    by_description,
    export_named,
    recognised,
    stacked,
)
from tissuejax.recordings.exports.meanings import bare, quantity_of, readable, sizes_of, split_unit
from tissuejax.recordings.exports.tracked import marker_export
from tissuejax.recordings.senses import signs_of, zeros_of
from tissuejax.recordings.side_file import KINEMATIC, SPECIMEN_UNITS
from tissuejax.recordings.specimen_sizes import column_sizes, stated_sizes
from tissuejax.units import quantity

_NAME_KEYS = (
    "specimen label",
    "sample name",
    "specimen name",
    "specimen id",
    "sample id",
    "sample",
    "specimen",
    "probe",
)
_PRESSED = re.compile(r"compress|druck|stauch", re.I)
_SHEARED = re.compile(r"shear|scher", re.I)
_OSCILLATING = re.compile(r"\bosc(illat\w*)?\b")


@dataclass(frozen=True)
class Guess:
    """Everything that a side file says, and the sentences on what was taken for granted.

    Attributes:
        path: the table.
        format: name of the raw export, "" for a plain table.
        reading: separator, decimal, skip, header, units_row of a plain table.
        experiment, positive: as in a side file.
        sample, recording: names or templates.
        pairs: columns (deformation and load) of each recording, with its label.
        time: the time column, None without one.
        time_fault: why the time column can't be used, "" where it can.
        signs: -1 or 1 by column.
        zeros: columns counted from their first sample.
        specimen: sizes with units, "?" where one is needed and not known.
        missing: whether rows with empty cells are left out.
        unused: columns that aren't used.
        said: sentences on what was assumed.
        machine: what wrote the file, "" where not known.
        where: rows kept, by column.
    """

    path: Path
    format: str
    reading: Mapping[str, object]
    experiment: str
    positive: str
    sample: str
    recording: str
    pairs: list[tuple[list[Guessed], str]]
    time: Guessed | None
    time_fault: str
    signs: Mapping[str, int]
    zeros: tuple[str, ...]
    specimen: Mapping[str, str]
    missing: bool
    unused: tuple[str, ...]
    said: tuple[str, ...]
    machine: str = ""
    where: Mapping[str, object] = field(default_factory=dict)

    @property
    def lacking(self) -> tuple[str, ...]:
        """Sizes that the side file needs and nobody has given."""
        return tuple(k for k, v in self.specimen.items() if v == "?")


def guessed(
    path: Path,
    experiment: str = "",
    positive: str = "",
    sizes: Mapping[str, str] | None = None,
    format: str = "",
    columns_told: Sequence[str] = (),
) -> Guess:
    """Look at a table and say what it holds.

    Args:
        path: the file.
        experiment, positive: where the user says them.
        sizes: specimen sizes that the user gives, texts with units.
        format: name of a raw export, where the user knows it.
        columns_told: what the columns hold, in their order, where the user says it; see `columns_guessed.told`.

    Raises:
        InputError: no table of numbers, no column of deformation or load, a kind of test that no experiment predicts.
    """
    kind, exported, reading, said = _content(path, format)
    columns, said = exported.columns, [*said, *exported.assumed]
    words = " ".join([path.stem, *exported.units, *exported.header, *map(str, exported.header.values())])
    unsaid = not experiment and not (kind and kind.experiment)
    experiment, why = (experiment, "") if experiment else _experiment(kind, exported, words)
    numbers = {n: v for n in exported.units if (v := _numbers(columns, n)) is not None}
    meanings = kind.meanings if kind else {}
    clocks, remarks = _clocks(columns, [n for n in exported.units if n not in numbers])
    numbers |= clocks
    said += remarks
    if columns_told:
        found = told(columns_told, [n for n in exported.units if n != BLOCK])
        words_only = [g.column for g in found if g.quantity and g.column not in numbers]
        if words_only:
            raise InputError(f"{path}: column {words_only[0]!r} holds no numbers; what --columns says doesn't fit")
    else:
        found = understood(exported.units, numbers, meanings, experiment == "simple-shear")
        # Behind a time in seconds, if there is one: clocks are often written to the second.
        found = [g for g in found if g.column not in clocks] + [
            Guessed(name, "time", "s", "", f"{name!r} holds times of day: read as seconds from the first one")
            for name in clocks
        ]
    if unsaid and experiment == "uniaxial" and two_axes(found, bool(columns_told)):
        experiment, why = "biaxial", "two deformations and two loads: taken as biaxial (--experiment says otherwise)"
    said += [why] if why else []
    _refuse_torsion(found, exported, path)
    standing, of_size, remarks = column_sizes(exported.units, numbers, meanings)
    said += remarks
    known = standing | stated_sizes(exported.header) | dict(sizes or {})
    for name, value in known.items():
        if quantity(value, SPECIMEN_UNITS[name], name) <= 0:
            raise InputError(f"{name} = {value!r}: expected a size above zero")
    try:
        pairs = chosen_pairs(found, experiment, tuple(known))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    blocks = columns.cells[BLOCK].astype(str) if BLOCK in columns.cells else np.full(len(columns.lines), "")
    time = chosen_time(found, numbers, blocks)
    fault = ""
    if time is not None and (row := backwards(numbers[time.column], blocks)) is not None:
        now, before = columns.text(time.column)[row], columns.text(time.column)[max(0, row - 1)]
        still = numbers[time.column][row] == numbers[time.column][max(0, row - 1)]
        way = f"stands still at line {columns.lines[row]} (two rows at {now}" if still else ""
        way = way or f"runs backwards at line {columns.lines[row]} ({now} after {before}"
        fault = (
            f"{way}), so it is left out and samples are taken as 1 s apart: mend the column and take the line in again"
        )
        said.append(f"the time column {time.column!r} {fault}")
    if time is None:
        said.append("no column of time was found: samples are taken as 1 s apart")
    used = [g for pair, _ in pairs for g in pair] + ([time] if time and not fault else [])
    said += list(dict.fromkeys(g.assumed for g in used if g.assumed))
    signs, positive, remarks = signs_of(pairs, numbers, experiment, positive, bool(_PRESSED.search(words)))
    said += remarks
    zeros, remarks = zeros_of(pairs, numbers, experiment)
    said += remarks
    specimen = _needed(pairs, experiment, known)
    empty = ~np.all([np.isfinite(numbers[g.column]) for g in used], axis=0)
    if len(pairs) == 1 and empty.any():
        said.append(f"{int(empty.sum())} rows have empty cells in these columns and are left out")
    if len(pairs) > 1:
        said.append(f"{len(pairs)} recordings side by side: {', '.join(label for _, label in pairs)}")
    return Guess(
        path=path,
        format=kind.name if kind else "",
        reading=reading,
        experiment=experiment,
        positive=positive,
        sample=_sample(exported.header, path),
        recording=f"{{{BLOCK}}}" if BLOCK in columns.cells else "r1",
        pairs=pairs,
        time=time,
        time_fault=fault,
        signs=signs,
        zeros=zeros,
        specimen=specimen,
        missing=bool(empty.any()),
        unused=tuple(n for n in exported.units if n not in {g.column for g in used} | {BLOCK, *of_size}),
        said=tuple(said),
        machine=kind.machine if kind and kind.name != "text" else "",
    )


def _content(path: Path, format: str) -> tuple[TableExport | None, Exported, dict[str, object], list[str]]:
    """The reader (None for a plain table), the content, how a plain table is read, and what was assumed."""
    if (points := marker_export(path)) is not None:
        raise InputError(
            f"{path}: a file of points by {points.program}: use it as markers of a probing, see "
            "`tissuejax import --template probe`"
        )
    kind = export_named(format) if format else recognised(path)
    if kind is not None:
        basis = f" ({UNSEEN})" if by_description(kind.basis) else ""
        return kind, kind.read(path), {}, [f"it is an export of {kind.machine}{basis}"] if kind.name != "text" else []
    lines = text_lines(path)
    whole = text.understood(lines)
    if not whole.tables:
        raise InputError(f"{path}: found no table of numbers, expected rows of numbers under a line of column names")
    sizes, tables = text.sizes_above(whole.tables)
    table = tables[0]
    after = table.first + len(table.rows)
    side_by_side = len(text.groups(table)) > 1
    wide = len(table.names) - len(text.split(lines[table.first], whole.separator))
    if len(tables) > 1 or side_by_side or wide > 0 or any(line.strip() for line in lines[after:]):
        kind = export_named("text")
        exported = kind.read(path)
        blocks = f"{len(exported.blocks)} tables" if len(exported.blocks) > 1 else "text after the table"
        if wide > 0:
            blocks = f"a line of names longer by {wide} than the rows (names count from the left)"
        return kind, exported, {}, [f'{blocks} found: read as format = "text"']
    top = table.names_at if table.names_at is not None else table.first
    exported = stacked(path, [table], text.header(lines[:top], whole.separator) | sizes, decimal=whole.decimal)
    reading: dict[str, object] = {"separator": text.NAMES[whole.separator]}
    if whole.decimal != ".":
        reading["decimal"] = whole.decimal
    if top:
        reading["skip"] = top
    if table.names_at is None:
        reading["header"] = False
        cells = {str(k + 1): v for k, v in enumerate(exported.columns.cells.values())}
        columns = Columns(path, cells, exported.columns.lines, whole.decimal)
        exported = Exported(columns, dict.fromkeys(cells, ""), exported.header, exported.blocks)
    if table.units_row:
        reading["units_row"] = True
    if table.names_at is not None and lines[table.names_at].startswith("#"):
        reading["comment"] = ""
    said = [f"cells are separated by {reading['separator']}, the decimal sign is {whole.decimal!r}"]
    return None, exported, reading, said


def _numbers(columns: Columns, name: str) -> np.ndarray | None:
    """A column as numbers; None where fewer than half of its filled cells are numbers."""
    try:
        return columns.numbers(name)
    except InputError:
        return None


def _clocks(columns: Columns, names: Sequence[str]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Columns of dates and times of day, as seconds; and sentences on times that can't be read."""
    found, said = {}, []
    for name in names:
        values = seconds(columns.text(name))
        if values is not None:
            found[name] = values
        elif quantity_of(split_unit(name)[0]) == "time":
            first = next((c for c in columns.text(name) if c.strip()), "")
            said.append(f"{name!r} can't be read as times ({first!r}), so it is not used")
    return found, said


def _experiment(kind: TableExport | None, exported: Exported, words: str) -> tuple[str, str]:
    if kind is not None and kind.experiment:
        return kind.experiment, ""
    names = [bare(split_unit(n)[0]) for n in exported.units]
    if any(_SHEARED.search(n) for n in names):
        return "simple-shear", "a column speaks of shear: taken as simple shear (--experiment says otherwise)"
    if any(_OSCILLATING.search(n) for n in names):
        return "simple-shear", (
            "a column speaks of oscillation, as rheometers do: taken as simple shear (--experiment says otherwise); "
            "where a row is a whole oscillation, the curve is one of amplitudes"
        )
    if any("indentation" in n or "penetration" in n for n in names) or any(
        "radius" in sizes_of(k) for k in exported.header
    ):
        return "probing", "the file speaks of an indentation: taken as a probing by a ball"
    return "uniaxial", "the kind of test isn't said: taken as uniaxial (--experiment says otherwise)"


def _refuse_torsion(found: list[Guessed], exported: Exported, path: Path) -> None:
    names = [bare(split_unit(n)[0]) for n in exported.units]
    if "torque" in names and not any(g.quantity in ("force", "nominal_stress", "true_stress") for g in found):
        raise InputError(
            f"{path}: holds torque over rotation; no experiment here takes the torsion of a bar. If the machine can "
            "export shear stress and shear strain (a rheometer can), export those and import them as simple-shear"
        )


def _needed(pairs: list[tuple[list[Guessed], str]], experiment: str, known: Mapping[str, str]) -> dict[str, str]:
    """The sizes known, and "?" for those that the columns need."""
    used = {g.quantity for pair, _ in pairs for g in pair}
    needed = {}
    if experiment == "cutting":
        return dict.fromkeys((*TISSUE, "thickness", "depth"), "?")
    if experiment == "probing":
        needed["radius"] = known.get("radius", "?")
        return {k: v for k, v in known.items() if k in ("height", "radius")} | needed
    if "displacement" in used:
        needed["height"] = known.get("height", "?")
    if "force" in used:
        has_area = "area" in known or "diameter" in known or {"width", "thickness"} <= known.keys()
        needed |= {} if has_area else {"area": "?"}
    kept = {k: v for k, v in known.items() if k in ("height", "diameter", "area", "width", "thickness")}
    return kept | needed if used & set(KINEMATIC) else needed


def _sample(header: Mapping[str, str], path: Path) -> str:
    named = {bare(k.rpartition(" : ")[2]): v for k, v in header.items()}
    for key in _NAME_KEYS:
        name = re.sub(r"[^\w .+-]", "-", named.get(key, "")).strip(" .")
        if 0 < len(name) <= 60 and not readable(name):
            return name
    return re.sub(r"[{}#/\\\x00-\x1f\x7f]", "-", path.name.removesuffix(".gz").rpartition(".")[0]) or "sample"
