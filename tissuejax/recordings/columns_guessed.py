"""What the columns of an unknown table hold: quantity, unit and label of each, and the ones that make a recording."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tissuejax.errors import InputError, unknown
from tissuejax.recordings.exports.meanings import (
    COLUMN_WORDS,
    IN_SHEAR,
    bare,
    quantity_by_unit,
    quantity_of,
    sizes_of,
    split_unit,
)
from tissuejax.recordings.side_file import KINEMATIC, QUANTITIES, STRESS
from tissuejax.units import factor

# Where no unit stands: what machines write most.
USUAL = {"time": "s", "displacement": "mm", "length": "mm", "force": "N", "nominal_stress": "MPa", "true_stress": "MPa"}
USUAL |= {"angle": "deg"}
# The better of several: engineering before true, stress and strain as given before force over an area not known.
PREFERRED = ("stretch", "strain", "length", "displacement", "true_strain", "shear", "angle", "radial_stretch")
LOADS = ("nominal_stress", "force", "true_stress")
# What a shear rig or a rheometer presses with: it stands across the sheared planes and is no load of the test.
_ACROSS = re.compile(r"\b(normal|axial|normalkraft|axialkraft|fn|fz|thrust)\b")


# What stands behind a quantity for an axis or a specimen: "stretch x", "stress 2", "force A1".
_LABEL = re.compile(r"[a-z]?\d{1,3}|[a-z]{1,2}")
AXES = (("x", "y"), ("1", "2"), ("xx", "yy"), ("11", "22"))
# Named by its unit alone, such a column is no measured load or deformation.
_OTHER = re.compile(
    r"modul|g'|e'|rate|error|std|sd|noise|set ?point|target|command|soll|amplitude|max|min|peak|pressure"
)


@dataclass(frozen=True)
class Guessed:
    """One column understood.

    Attributes:
        column: its name in the file.
        quantity: one of the side file's quantities, or "".
        unit: as it stands, or assumed.
        label: what stands before the quantity in the name ("VA1" in "VA1_force_kN") or behind it ("x" in
            "stress x"), or "".
        assumed: a sentence on what was taken for granted, or "".
    """

    column: str
    quantity: str
    unit: str
    label: str = ""
    assumed: str = ""


def understood(
    units: Mapping[str, str], numbers: Mapping[str, np.ndarray], meanings: Mapping[str, str], shear: bool
) -> list[Guessed]:
    """Every column of a table, in order.

    Args:
        units: unit by column as it stands, "" for none.
        numbers: the columns that hold numbers.
        meanings: bare names that the format knows; "" says that a column is of no use.
        shear: whether the test is known to be a shear test.
    """
    found = [_one(name, unit, numbers[name], meanings, shear) for name, unit in units.items() if name in numbers]
    found = _left_over(found, meanings, shear)
    return [_ratio(g, found, numbers) if g.quantity == "strain" and g.assumed else g for g in found]


def told(columns: Sequence[str], names: Sequence[str]) -> list[Guessed]:
    """Columns as a user tells them, in the table's order: "time s", "displacement mm", "-" for one of no use.

    Raises:
        InputError: more columns than there are, a word that is no quantity, a unit of another kind.
    """
    if len(columns) > len(names):
        raise InputError(f"--columns tells of {len(columns)} columns, the table has {len(names)}: {', '.join(names)}")
    found = []
    for name, text in zip(names, [*columns, *["-"] * (len(names) - len(columns))], strict=True):
        word, _, unit = text.strip().partition(" ")
        word = COLUMN_WORDS.get(word.lower(), word.lower())
        if word in ("-", ""):
            found.append(Guessed(name, "", ""))
            continue
        if word not in QUANTITIES:
            raise InputError(f"--columns: {unknown('quantity', word, [*QUANTITIES, '-'])}")
        if not unit and QUANTITIES[word] != "1":
            raise InputError(f"--columns: {text.strip()!r} has no unit; write e.g. '{word} {USUAL.get(word, 'mm')}'")
        factor(unit or "1", QUANTITIES[word])
        found.append(Guessed(name, word, unit.strip() or "1"))
    return found


def _left_over(found: list[Guessed], meanings: Mapping[str, str], shear: bool) -> list[Guessed]:
    """Where no column names a load, or none a deformation: the one column left whose unit says that it may be it."""
    for group, names in ((STRESS, ("force", "nominal_stress")), (KINEMATIC, ("displacement", "strain"))):
        if any(g.quantity in group for g in found):
            continue
        free = [g for g in found if not g.quantity and g.unit and quantity_by_unit(g.unit) in names]
        texts = {g.column: bare(split_unit(g.column)[0]) for g in free}
        free = [
            g
            for g in free
            if texts[g.column] not in meanings
            and not _OTHER.search(texts[g.column])
            and not sizes_of(g.column)
            and not (shear and _ACROSS.search(texts[g.column]))
        ]
        if len(free) == 1:
            quantity = str(quantity_by_unit(free[0].unit))
            what = "load" if group is STRESS else "deformation"
            said = f"{free[0].column!r} is the one column left with a unit of {quantity.replace('nominal_', '')} "
            said += f"({free[0].unit}): taken as the {what}"
            taken = replace(free[0], quantity=IN_SHEAR.get(quantity, quantity) if shear else quantity, assumed=said)
            found = [taken if g is free[0] else g for g in found]
    return found


def _ratio(strain: Guessed, found: Sequence[Guessed], numbers: Mapping[str, np.ndarray]) -> Guessed:
    """A strain taken as percent is a ratio after all if a column of true strain says ln(1 + strain)."""
    for other in found:
        if other.quantity == "true_strain":
            e, true = numbers[strain.column], numbers[other.column]
            with np.errstate(invalid="ignore"):
                if np.nanmax(np.abs(np.log1p(e) - true)) < 0.01 * np.nanmax(np.abs(true)):
                    return replace(strain, unit="1", assumed="")
    return strain


def _one(name: str, unit: str, values: np.ndarray, meanings: Mapping[str, str], shear: bool) -> Guessed:
    base = split_unit(name)[0]
    label = ""
    text = re.sub(r" \d+$", "", bare(base)) if name.endswith(")") and not unit else bare(base)
    meaning = meanings.get(text)
    quantity = meaning if meaning is not None else quantity_of(base, unit)
    if quantity is None:
        words = text.split()
        for k in range(1, len(words)):
            quantity = quantity_of(" ".join(words[k:]), unit)
            if quantity:
                label = " ".join(words[:k])
                break
        if not quantity and len(words) > 1 and _LABEL.fullmatch(words[-1]):
            quantity, label = quantity_of(" ".join(words[:-1]), unit), words[-1]
    if not quantity or quantity not in QUANTITIES:
        return Guessed(name, "", unit)
    if shear and quantity in STRESS and _ACROSS.search(text):
        return Guessed(name, "", unit)
    quantity = IN_SHEAR.get(quantity.replace("nominal_", ""), quantity) if shear else quantity
    if quantity == "displacement" and unit and _fits(unit, "rad") and not _fits(unit, "1"):
        quantity = "angle"
    if unit and not _fits(unit, QUANTITIES[quantity]):
        return Guessed(name, "", unit)
    assumed = ""
    if not unit:
        unit, assumed = _usual(name, quantity, values)
    return Guessed(name, quantity, unit, label, assumed)


def _fits(unit: str, si: str) -> bool:
    try:
        factor(unit, si)
    except InputError:
        return False
    return True


def _usual(name: str, quantity: str, values: np.ndarray) -> tuple[str, str]:
    if quantity not in USUAL:
        if quantity in ("strain", "true_strain", "shear") and np.nanmax(np.abs(values), initial=0.0) > 5:
            return "%", f"{name!r} reaches {np.nanmax(np.abs(values)):.3g} and has no unit: taken as percent"
        return "1", ""
    return USUAL[quantity], f"{name!r} has no unit: taken as {USUAL[quantity]}"


def chosen_time(found: Sequence[Guessed], numbers: Mapping[str, np.ndarray], blocks: np.ndarray) -> Guessed | None:
    """The first time column that runs forwards within each block; else the first one at all; None without one."""
    times = [g for g in found if g.quantity == "time"]
    return next((g for g in times if backwards(numbers[g.column], blocks) is None), times[0] if times else None)


_TOLD = {
    "biaxial": "time s, stretch, stretch, stress kPa, stress kPa",
    "simple-shear": "time s, shear, stress kPa",
    "equibiaxial": "time s, stretch, stress kPa",
}


def backwards(values: np.ndarray, blocks: np.ndarray) -> int | None:
    """The first row at which a time doesn't increase within its block, or None."""
    seen = np.flatnonzero(np.isfinite(values))
    bad = np.flatnonzero((np.diff(values[seen]) <= 0) & (blocks[seen][1:] == blocks[seen][:-1]))
    return int(seen[bad[0] + 1]) if len(bad) else None


def two_axes(found: Sequence[Guessed], plainly: bool = False) -> bool:
    """Whether columns are of a biaxial test: two deformations of one quantity and two loads of one, of both axes.

    Args:
        found: the columns understood.
        plainly: whether two of each are enough, because the user told what they are.
    """
    axes = []
    for group in (KINEMATIC, STRESS):
        for quantity in dict.fromkeys(g.quantity for g in found if g.quantity in group):
            two = [g for g in found if g.quantity == quantity]
            axis = tuple(g.label or bare(split_unit(g.column)[0]).split()[-1] for g in two)
            if len(two) == 2 and (plainly or axis in AXES):
                axes.append(() if plainly else axis)
                break
    return len(axes) == 2 and axes[0] == axes[1]


def chosen_pairs(found: Sequence[Guessed], experiment: str, sizes: Sequence[str]) -> list[tuple[list[Guessed], str]]:
    """The deformation and load columns of each recording in the table, with the recording's label.

    One pair for a plain table; one for each label where columns differ by what stands before the quantity. A biaxial
    test has two deformations and two loads (columns named X and Y, or 1 and 2).

    Raises:
        InputError: no column of deformation or of load; which columns there are.
    """
    motions = [g for g in found if g.quantity in KINEMATIC]
    loads = [g for g in found if g.quantity in STRESS]
    if not motions or not loads:
        missing = "deformation (stretch, strain, displacement, length ...)" if not motions else "load (force, stress)"
        there = ", ".join(repr(g.column) for g in found)
        raise InputError(
            f"found no column of {missing} among {there}: write the side file by hand from "
            f"`tissuejax import --template {experiment or 'uniaxial'}`, or say what the columns are, in their order "
            f'(--columns "{_TOLD.get(experiment, "time s, displacement mm, force N")}"; "-" for one that is not used)'
        )
    if experiment == "biaxial":
        return [(_axes(motions) + _axes(loads), "")]
    plain = [g for g in loads if not g.label]
    labels = list(dict.fromkeys(g.label for g in loads)) if not plain else [""]
    pairs = []
    for label in labels:
        own = [g for g in loads if g.label == label]
        with_it = [g for g in motions if g.label == label] or [g for g in motions if not g.label] or motions
        load = min(own, key=lambda g: LOADS.index(g.quantity))
        motion = min(with_it, key=lambda g: PREFERRED.index(g.quantity))
        # A crosshead reading over a known height goes with a force; strain and stress go together.
        moved = [g for g in with_it if g.quantity == "displacement"]
        if load.quantity == "force" and moved and (experiment == "probing" or "height" in sizes):
            motion = moved[0]
        pairs.append(([motion, load], label))
    return pairs


def _axes(columns: Sequence[Guessed]) -> list[Guessed]:
    """The two columns of the best quantity of which there are two."""
    order = (*PREFERRED, *LOADS)
    for quantity in sorted({g.quantity for g in columns}, key=order.index):
        two = [g for g in columns if g.quantity == quantity]
        if len(two) >= 2:
            return two[:2]
    names = ", ".join(repr(g.column) for g in columns)
    raise InputError(f"a biaxial test needs two columns of one quantity, found {names}; name another --experiment")
