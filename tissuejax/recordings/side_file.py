"""The TOML side file that describes a lab's own table; parsed and checked here, carried out in `table.py`."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from tissuejax.errors import InputError, unknown
from tissuejax.recordings.cutting_table import Setup, setup_from
from tissuejax.recordings.exports.meanings import (
    BY_UNIT,
    COLUMN_WORDS,
    EXPERIMENT_WORDS,
    SIZE_WORDS,
    quantity_by_unit,
)
from tissuejax.recordings.layouts import LAYOUTS
from tissuejax.recordings.selection import Selection, selection_from
from tissuejax.units import factor, quantity

# What a column may hold, and the SI unit that its own unit must convert to.
QUANTITIES = {
    "time": "s",
    "stretch": "1",
    "strain": "1",
    "true_strain": "1",
    "radial_stretch": "1",
    "length": "m",
    "displacement": "m",
    "shear": "1",
    "angle": "rad",
    "nominal_stress": "Pa",
    "true_stress": "Pa",
    "force": "N",
    "force_z": "N",
    "depth": "m",
}
KINEMATIC = tuple(QUANTITIES)[1:9]
STRESS = tuple(QUANTITIES)[9:12]
OF_CUTS = tuple(QUANTITIES)[12:]  # beside force and displacement, in tables of cuts alone
# These turn round where compression is counted positive.
SIGNED = ("strain", "true_strain", "displacement", "nominal_stress", "true_stress", "force")
SPECIMEN_UNITS = {
    "height": "m",
    "diameter": "m",
    "area": "m^2",
    "width": "m",
    "thickness": "m",
    "frozen_height": "m",
    "frozen_diameter": "m",
    "radius": "m",
}
# fmt: off
PART = (
    "file", "where", "sample", "recording", "experiment", "positive", "columns", "specimen", "noise",
    "attributes", "every", "missing", "settling", "relative_to_first", "lowpass", "separator",
    "decimal", "comment", "skip", "header", "units_row", "format", "direction", "normal",
    "cycles", "phase", "upto", "preload", "toe", "tissue", "blade",
)
# fmt: on
READING = ("separator", "decimal", "comment", "skip", "header", "units_row", "format")
OF_SAMPLE = ("part", "source", "notes", "density")
Value = TypeVar("Value")


@dataclass(frozen=True)
class Column:
    """One column of the table: where it is, and what turns it into SI."""

    column: str | int
    unit: str
    sign: float = 1.0
    zero: int = 0


@dataclass(frozen=True)
class Lookup:
    """A second table that gives specimen sizes by a key column (one row a specimen)."""

    file: str
    key: str | int


@dataclass(frozen=True)
class Part:
    """One kind of test in a table: which rows, what kind of experiment, what the columns hold.

    `columns` holds one or two columns a quantity; `specimen` holds numbers in SI or columns; `noise` holds text
    ("0.02 N", "estimate") or a column.
    """

    file: str
    experiment: str
    columns: Mapping[str, tuple[Column, ...]]
    sample: str = "sample"
    recording: str = "r1"
    where: Mapping[str, object] = field(default_factory=dict)
    positive: str = "tension"
    specimen: Mapping[str, float | Column] = field(default_factory=dict)
    lookup: Lookup | None = None
    noise: Mapping[str, str | Column] = field(default_factory=dict)
    attributes: Mapping[str, float] = field(default_factory=dict)
    every: int = 1
    missing: str = "refuse"
    settling: bool = False
    relative_to_first: bool = False
    lowpass: float | None = None
    direction: tuple[float, float, float] | None = None
    normal: tuple[float, float, float] | None = None
    selection: Selection = Selection()
    cut: Setup | None = None
    reading: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class SideFile:
    """A whole side file: its parts, and what holds for every sample in it."""

    path: Path
    parts: tuple[Part, ...]
    source: str = ""
    notes: str = ""
    density: float | None = None


def parse(path: Path) -> SideFile:
    """Read a side file.

    Raises:
        InputError: no TOML, an unknown key (the nearest are offered), a missing one, a wrong type or unit.
    """
    try:
        content = tomllib.loads(path.read_text("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: found text that is not TOML ({error}), expected a side file") from error
    if "body" in content:
        raise InputError(
            f"{path}: describes a probing of a body, which has to be meshed: `tissuejax import {path}` makes a "
            "recording file (.h5) of it"
        )
    for key in content:
        if key not in PART and key not in OF_SAMPLE:
            raise InputError(f"{path}: {unknown('key', key, [*PART, *OF_SAMPLE])}")
    shared = {k: v for k, v in content.items() if k in PART}
    own = content.get("part", [{}])
    if not isinstance(own, list) or not all(isinstance(p, dict) for p in own):
        raise InputError(f"{path}: part: found one table, expected a list: write [[part]]")
    density = content.get("density")
    try:
        return SideFile(
            path,
            tuple(_part(_merged(shared, p)) for p in own),
            _typed(content, "source", str, ""),
            _typed(content, "notes", str, ""),
            None if density is None else quantity(density, "kg/m^3", "density"),
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _merged(shared: Mapping[str, object], own: Mapping[str, object]) -> dict[str, object]:
    """A part's own keys over the shared ones; tables are merged key by key."""
    both = dict(shared)
    for key, value in own.items():
        before = shared.get(key)
        both[key] = {**before, **value} if isinstance(value, dict) and isinstance(before, dict) else value
    return both


def _typed(table: Mapping[str, object], key: str, kind: type[Value], default: Value) -> Value:
    if key not in table:
        return default
    value = table[key]
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise InputError(f"{key}: found {value!r}, expected {'a table' if kind is dict else f'a {kind.__name__}'}")
    return value


def _part(table: Mapping[str, object]) -> Part:
    for key in table:
        if key not in PART:
            raise unknown("key", key, PART)
    for key in ("file", "experiment", "columns"):
        if key not in table:
            raise InputError(f"{key}: found nothing, expected {_EXAMPLES[key]}")

    def get(key: str, kind: type[Value], default: Value) -> Value:
        return _typed(table, key, kind, default)

    experiment, sense = experiment_of(get("experiment", str, ""))
    specimen = _in_our_words(get("specimen", dict, {}), SIZE_WORDS, SPECIMEN_UNITS, "specimen")
    lookup = None
    if "file" in specimen or "key" in specimen:
        if not {"file", "key"} <= specimen.keys():
            raise InputError('specimen: expected both file = "sizes.csv" and key = "the column that names the test"')
        file, key = specimen.pop("file"), specimen.pop("key")
        if not isinstance(file, str) or not isinstance(key, str | int):
            raise InputError(
                f"specimen: found file = {file!r} and key = {key!r}, expected the names of a file and a column"
            )
        lookup = Lookup(file, key)
    lowpass, cut = table.get("lowpass"), None
    if experiment == "cutting":
        cut = setup_from(get("tissue", dict, {}), get("blade", dict, {}))
    elif "tissue" in table or "blade" in table:
        raise InputError(f"[tissue] and [blade] are of a cutting test, and this is {experiment}: leave them out")
    columns = _columns(_in_our_words(get("columns", dict, {}), COLUMN_WORDS, QUANTITIES, "columns"))
    if cut is None and (odd := [q for q in columns if q in OF_CUTS]):
        raise InputError(f"columns: {odd[0]} is a quantity of a cutting test, and this is {experiment}: leave it out")
    return Part(
        file=get("file", str, ""),
        experiment=experiment,
        columns=columns,
        sample=get("sample", str, "sample"),
        recording=get("recording", str, "r1"),
        where=get("where", dict, {}),
        positive=_choice({"positive": sense or "tension", **table}, "positive", ("tension", "compression")),
        specimen={k: _size(k, v) for k, v in specimen.items()},
        lookup=lookup,
        noise={
            k: _noise(k, v) for k, v in _in_our_words(get("noise", dict, {}), COLUMN_WORDS, QUANTITIES, "noise").items()
        },
        attributes=_numbers(get("attributes", dict, {})),
        every=max(1, get("every", int, 1)),
        missing=_choice(table, "missing", ("refuse", "drop")),
        settling=get("settling", bool, False),
        relative_to_first=get("relative_to_first", bool, False),
        lowpass=None if lowpass is None else quantity(lowpass, "Hz", "lowpass"),
        direction=_direction("direction", table.get("direction")),
        normal=_direction("normal", table.get("normal")),
        selection=selection_from(table),
        cut=cut,
        reading={k: table[k] for k in READING if k in table},
    )


def experiment_of(word: str) -> tuple[str, str]:
    """The kind of experiment that a word names, and the sense that counts positive where the word says so.

    Raises:
        InputError: an unknown word; the nearest kinds and words are offered.
    """
    if word in LAYOUTS:
        return word, ""
    plain = word.strip().lower().replace("_", "-")
    if plain in LAYOUTS:
        return plain, ""
    if plain in EXPERIMENT_WORDS:
        kind, sense = EXPERIMENT_WORDS[plain]
        # A probing counts its depth positive whatever is said.
        return kind, "" if kind == "probing" else sense
    raise unknown("experiment kind", word, [*LAYOUTS, *EXPERIMENT_WORDS])


def _in_our_words(
    table: Mapping[str, object], words: Mapping[str, str], ours: Mapping[str, str], place: str
) -> dict[str, object]:
    """A table with natural words for its keys turned into the project's own ("load" into "force").

    Raises:
        InputError: a key and its other name at once.
    """
    found: dict[str, object] = {}
    for key, value in table.items():
        # "length" is a quantity of [columns] in its own right and another word for the height in [specimen].
        name = key if key in ours else words.get(key.lower(), key)
        if words is COLUMN_WORDS and key.lower() in BY_UNIT:
            first = value[0] if isinstance(value, list) and value else value
            unit = first.get("unit", "") if isinstance(first, dict) else str(first).partition(" ")[2]
            name = quantity_by_unit(str(unit)) or key
        if name in found:
            raise InputError(f"{place}.{key}: given twice, {key!r} being another word for {name!r}: keep one")
        found[name] = value
    return found


def _direction(name: str, value: object) -> tuple[float, float, float] | None:
    """A direction in the sample's own frame, of length one."""
    if value is None:
        return None
    numbers = isinstance(value, list) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value)
    if isinstance(value, list) and numbers and len(value) == 3:
        x, y, z = value
        length = sum(v * v for v in value) ** 0.5
        if 0 < length < float("inf"):
            return x / length, y / length, z / length
    raise InputError(f"{name}: found {value!r}, expected three numbers, such as [1, 0, 0], in the tissue's own frame")


_EXAMPLES = {
    "file": 'the table, e.g. file = "tests.csv"',
    "experiment": 'the kind of test, e.g. experiment = "uniaxial"',
    "columns": 'what the columns hold, e.g. [columns] with force = { column = "load", unit = "N" }',
}


def _choice(table: Mapping[str, object], key: str, allowed: tuple[str, ...]) -> str:
    value = table.get(key, allowed[0])
    if not isinstance(value, str) or value not in allowed:
        raise InputError(f"{key}: found {value!r}, expected {' or '.join(repr(a) for a in allowed)}")
    return value


def _columns(table: Mapping[str, object]) -> dict[str, tuple[Column, ...]]:
    found = {}
    for name, spec in table.items():
        if name not in QUANTITIES:
            raise unknown("quantity in [columns]", name, QUANTITIES)
        specs = spec if isinstance(spec, list) else [spec]
        if not 1 <= len(specs) <= 2:
            raise InputError(f"columns.{name}: found {len(specs)} columns, expected one, or two for a biaxial test")
        found[name] = tuple(_column(f"columns.{name}", s, QUANTITIES[name]) for s in specs)
    for group, what in ((KINEMATIC, "the deformation"), (STRESS, "the load")):
        given = [k for k in found if k in group]
        if len(given) != 1:
            came = " and ".join(given) or "nothing"
            raise InputError(f"columns: found {came} for {what}, expected exactly one of {', '.join(group)}")
    return found


def _column(place: str, spec: object, si: str) -> Column:
    if not isinstance(spec, dict) or "column" not in spec:
        raise InputError(f'{place}: found {spec!r}, expected {{ column = "name", unit = "{si}" }}')
    for key in spec:
        if key not in ("column", "unit", "sign", "zero"):
            raise InputError(f"{place}: {unknown('key', key, ('column', 'unit', 'sign', 'zero'))}")
    if "unit" not in spec and si != "1":
        raise InputError(f'{place}: found no unit, expected one that converts to {si!r}, e.g. unit = "{si}"')
    unit = spec.get("unit", "1")
    try:
        factor(unit, si)
    except InputError as error:
        raise InputError(f"{place}: {error}") from error
    sign, zero = spec.get("sign", 1), spec.get("zero", 0)
    if sign not in (1, -1):
        raise InputError(f"{place}.sign: found {sign!r}, expected 1 or -1")
    if not isinstance(zero, int) or zero < 0:
        raise InputError(f"{place}.zero: found {zero!r}, expected true or how many first samples are averaged as zero")
    return Column(spec["column"], unit, float(sign), int(zero))


def _size(name: str, value: object) -> float | Column:
    if name not in SPECIMEN_UNITS:
        raise InputError(str(unknown("size in [specimen]", name, [*SPECIMEN_UNITS, "file", "key"])))
    if value == "?":
        raise InputError(f'specimen.{name}: found "?", expected a size: measure it and write it here, e.g. "25 mm"')
    if isinstance(value, dict):
        return _column(f"specimen.{name}", value, SPECIMEN_UNITS[name])
    size = quantity(value, SPECIMEN_UNITS[name], f"specimen.{name}")
    if size <= 0:
        raise InputError(f"specimen.{name}: found {value!r}, expected a size above zero")
    return size


def _noise(name: str, value: object) -> str | Column:
    if name not in QUANTITIES or name == "time":
        raise unknown("quantity in [noise]", name, [q for q in QUANTITIES if q != "time"])
    if isinstance(value, dict):
        return _column(f"noise.{name}", value, QUANTITIES[name])
    if value != "estimate" and quantity(value, QUANTITIES[name], f"noise.{name}") <= 0:
        raise InputError(
            f"noise.{name}: found {value!r}, expected a standard deviation above zero; leave the line out where the "
            "noise was not recorded"
        )
    return str(value)


def _numbers(table: Mapping[str, object]) -> dict[str, float]:
    found = {}
    for name, value in table.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"attributes.{name}: found {value!r}, expected a number in SI")
        found[name] = float(value)
    return found
