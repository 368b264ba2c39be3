"""The rows of one test turned into a Recording: units, signs, zeroing, filter, then stretch and nominal stress."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from tissuejax.errors import InputError
from tissuejax.recordings import checks, rig
from tissuejax.recordings import conversions as convert
from tissuejax.recordings.cutting_table import cut_from
from tissuejax.recordings.delimited import Columns
from tissuejax.recordings.recording import NO_TIME, Channel, Recording
from tissuejax.recordings.selection import chosen, start_of
from tissuejax.recordings.side_file import KINEMATIC, QUANTITIES, SIGNED, STRESS, Column, Part
from tissuejax.units import factor, quantity

SHEARED = ("shear", "angle", "displacement")
Sizes = Mapping[str, float]


def recording_from(
    part: Part, columns: Columns, rows: np.ndarray, sizes: Sizes, name: str, place: str, side: Path = Path()
) -> tuple[Recording, list[str]]:
    """The recording in `rows` of a table, and what to note about how it came to be.

    Args:
        part: what the side file says of these rows.
        columns: the table.
        rows: indices of the rows, in order.
        sizes: specimen sizes, SI.
        name: the recording's name.
        place: file, sample and recording, for messages.
        side: the side file, beside which further files are.

    Raises:
        InputError: missing or bad cells (with line and column), times that don't increase, stretch <= 0, a missing
            specimen size, a quantity that doesn't go with the experiment, fewer than 2 samples.
    """
    notes = []
    values, rows = _numbers(part, columns, rows, place)
    if len(rows) < 2:
        raise checks.refusal(place, "rows", f"{len(rows)} sample(s)", "at least 2 to be looked at, and 3 to be fitted")
    timed = "time" in values
    time = values.pop("time", np.arange(len(rows), dtype=float))
    if not timed:
        notes.append(NO_TIME)
    checks.increasing(time, place, f"column {part.columns['time'][0].column!r}" if timed else "time")
    if part.lowpass is not None:
        values = {q: rig.lowpass(time, v, part.lowpass) for q, v in values.items()}
        notes.append(f"Butterworth low-pass at {part.lowpass:g} Hz.")
    kinematic = next(q for q in values if q in KINEMATIC)
    load = next(q for q in values if q in STRESS)
    if part.selection:
        kept = selected(part, values, kinematic, load, sizes, place)
        time, values, rows, sizes = time[kept.rows], kept.values, rows[kept.rows], kept.sizes
        notes += kept.notes
        if timed and part.columns["time"][0].zero:
            time = time - time[0]
    keep = slice(None, None, part.every)
    time, values = time[keep], {q: v[keep] for q, v in values.items()}
    given = {k: sizes[k] for k in ("height", "diameter") if k in sizes}
    attributes: dict[str, float | np.ndarray] = {**part.attributes, **given}
    if part.direction is not None:
        attributes["direction"] = np.array(part.direction)
    if part.normal is not None:
        attributes["normal"] = np.array(part.normal)
    if part.cut is not None:
        noise = part.noise.get("force", "estimate")
        if isinstance(noise, Column):
            noise = f"{_said(noise, 'force', columns, rows)} N"
        return cut_from(part.cut, time, values, noise, side, name, place), notes
    if part.experiment == "probing":
        return _probing(part, time, values, kinematic, load, sizes, name, place, attributes), notes
    motion = _motion(part, values[kinematic], kinematic, sizes, place)
    area = _area(sizes, place) if load == "force" else None
    if area is not None:
        attributes["area"] = area
    stress, per_unit = _stress(values[load], load, motion, area, part, place)
    abscissa = time if timed else convert.path_length(motion)
    noise = _noise(part, load, columns, rows, per_unit, abscissa, stress)
    key = "shear" if part.experiment == "simple-shear" else "stretch"
    stated = part.noise.get(kinematic)
    if stated is not None and stated != "estimate":
        slope = _slope(values[kinematic], motion, kinematic, sizes)
        attributes[f"{key}/noise_std"] = _said(stated, kinematic, columns, rows) * slope
    channel = Channel(time, stress, "Pa", noise)
    return Recording(name, part.experiment, {"time": time, key: motion}, {"nominal_stress": channel}, attributes), notes


class Kept(NamedTuple):
    """What a selection leaves of one test.

    Attributes:
        rows: places among the test's rows.
        values: the columns of these rows, deformation counted from its new zero.
        sizes: specimen sizes; the height is the new one where lengths were measured.
        notes: what was done.
        zero: what the deformation read where it counts from; None where that was not moved.
    """

    rows: np.ndarray
    values: dict[str, np.ndarray]
    sizes: Sizes
    notes: list[str]
    zero: float | None = None


@dataclass(frozen=True)
class Considered:
    """All rows of one test and which of them a selection keeps, in SI, for a picture.

    Attributes:
        name: of the recording.
        time: s, or the row's number where no time was recorded (not `timed`).
        motion, load: the measured columns, the first axis of two.
        motion_name, load_name, motion_unit, load_unit: what they are.
        kept: whether the row is in the recording.
        notes: what was done.
        zero: of `motion`, from where the deformation counts; None where that was not moved.
    """

    name: str
    time: Float[np.ndarray, " n"]
    motion: Float[np.ndarray, " n"]
    load: Float[np.ndarray, " n"]
    motion_name: str
    load_name: str
    motion_unit: str
    load_unit: str
    kept: Bool[np.ndarray, " n"]
    notes: tuple[str, ...]
    timed: bool = True
    zero: float | None = None


def considered(part: Part, columns: Columns, rows: np.ndarray, sizes: Sizes, name: str, place: str) -> Considered:
    """What `recording_from` chooses from, and what it keeps.

    Raises:
        InputError: as `recording_from`.
    """
    values, rows = _numbers(part, columns, rows, place)
    timed = "time" in values
    time = values.pop("time", np.arange(len(rows), dtype=float))
    motion = next(q for q in values if q in KINEMATIC)
    load = next(q for q in values if q in STRESS)
    chosen_rows = selected(part, values, motion, load, sizes, place)
    kept = np.zeros(len(rows), bool)
    kept[chosen_rows.rows[:: part.every]] = True
    first = {q: values[q].reshape(len(rows), -1)[:, 0] for q in (motion, load)}
    units = QUANTITIES[motion], QUANTITIES[load]
    return Considered(
        name,
        time,
        first[motion],
        first[load],
        motion,
        load,
        *units,
        kept,
        tuple(chosen_rows.notes),
        timed,
        chosen_rows.zero,
    )


def selected(part: Part, values: Mapping[str, np.ndarray], kinematic: str, load: str, sizes: Sizes, place: str) -> Kept:
    """The rows that the side file's selection keeps, see `selection`; deformation counts from preload or toe.

    Raises:
        InputError: nothing left, a cycle that isn't there, a preload that is never reached.
    """
    rule = part.selection
    mask, notes = chosen(rule, values[kinematic], values[load], place)
    rows = np.flatnonzero(mask)
    if not rule.preload and rule.toe is None:
        return Kept(rows, {q: v[rows] for q, v in values.items()}, sizes, notes)
    if values[kinematic].ndim != 1:
        raise checks.refusal(place, "preload, toe", "a biaxial test", "a test with one load: cut the rows by `where`")
    first, zero, said = start_of(rule, values[kinematic][rows], values[load][rows], place, QUANTITIES[load])
    rows = rows[first:]
    if len(rows) < 2:
        raise checks.refusal(
            place, "preload, toe", f"{len(rows)} row(s) left", "at least 2 to be looked at, and 3 to be fitted"
        )
    left = {q: v[rows] for q, v in values.items()}
    if kinematic == "length":
        sizes = {**sizes, "height": zero}
    else:
        left[kinematic] = _from_zero(left[kinematic], kinematic, zero)
    return Kept(rows, left, sizes, notes + said, zero)


def _from_zero(values: np.ndarray, kind: str, zero: float) -> np.ndarray:
    """A measure of deformation referred to the state in which it read `zero`."""
    if kind in ("stretch", "radial_stretch"):
        return values / zero
    return (1 + values) / (1 + zero) - 1 if kind == "strain" else values - zero


def _numbers(part: Part, columns: Columns, rows: np.ndarray, place: str) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Columns in SI with sign and zero applied, and the rows kept."""
    read = {q: columns.times if q == "time" else columns.numbers for q in part.columns}
    raw = {q: np.stack([read[q](c.column)[rows] for c in cs], axis=1) for q, cs in part.columns.items()}
    bad = np.any([~np.isfinite(v).all(axis=1) for v in raw.values()], axis=0)
    if bad.any() and part.missing == "drop":
        raw, rows = {q: v[~bad] for q, v in raw.items()}, rows[~bad]
    for q, v in raw.items():
        broken = np.argwhere(~np.isfinite(v))
        if len(broken):
            i, j = broken[0]
            item = f"line {columns.lines[rows[i]]}, column {part.columns[q][j].column!r}"
            found = f"{v[i, j]} ({len(broken)} such cells)"
            raise checks.refusal(place, item, found, "a number", 'missing = "drop" leaves such rows out.')
    turned = {"compression": -1.0, "tension": 1.0}[part.positive]
    values = {}
    for q, v in raw.items():
        scaled = [
            _scaled(v[:, j], c, QUANTITIES[q], turned if q in SIGNED else 1.0) for j, c in enumerate(part.columns[q])
        ]
        values[q] = np.stack(scaled, axis=1) if len(scaled) > 1 else scaled[0]
    return values, rows


def _scaled(values: np.ndarray, column: Column, si: str, turned: float) -> np.ndarray:
    if column.zero and len(values):
        values = values - values[: column.zero].mean()
    return values * (factor(column.unit, si) * column.sign * turned)


def _need(sizes: Sizes, name: str, what: str, place: str) -> float:
    if name not in sizes:
        raise checks.refusal(place, f"specimen.{name}", "nothing", f"a size, to turn {what}", "Add it to [specimen].")
    return sizes[name]


def _motion(part: Part, values: np.ndarray, kind: str, sizes: Sizes, place: str) -> np.ndarray:
    """Stretch, or the amount of shear, from what was measured."""
    two = values.ndim == 2
    if two != (part.experiment == "biaxial"):
        found = f"{2 if two else 1} column(s) of {kind}"
        raise checks.refusal(place, "columns", found, "two for a biaxial test, one for any other")
    if (part.experiment == "simple-shear") != (kind in ("shear", "angle")) and kind != "displacement":
        expected = f"one of {', '.join(q for q in KINEMATIC if (q in SHEARED) == (part.experiment == 'simple-shear'))}"
        raise checks.refusal(place, f"columns for {part.experiment}", kind, expected)
    if kind == "radial_stretch" and part.experiment != "uniaxial":
        raise checks.refusal(place, f"columns for {part.experiment}", kind, "radial_stretch in a uniaxial test only")
    if part.experiment == "simple-shear":
        if kind == "displacement":
            return values / _need(sizes, "height", "displacement into shear", place)
        return np.tan(values) if kind == "angle" else values
    if kind == "displacement":
        height = _need(sizes, "height", "displacement into stretch", place)
        checks.shorter(values, height, place)
        stretch = convert.stretch_from_displacement(values, height)
    elif kind == "length":
        stretch = values / sizes.get("height", values[0])
    else:
        if kind == "radial_stretch":
            checks.stretches(values, place, "column of radial_stretch")
        stretch = {
            "stretch": lambda v: v,
            "strain": convert.stretch_from_strain,
            "true_strain": convert.stretch_from_true_strain,
            "radial_stretch": rig.compression_stretch,
        }[kind](values)
    checks.stretches(stretch, place, f"stretch from {kind}")
    if part.settling:
        frozen = _need(sizes, "frozen_height", "the settled height back", place)
        stretch = rig.settled_stretch(stretch, frozen, _need(sizes, "height", "the settled height back", place))
    return stretch / stretch[0] if part.relative_to_first else stretch


def _area(sizes: Sizes, place: str) -> float:
    if "area" in sizes:
        return sizes["area"]
    if "width" in sizes and "thickness" in sizes:
        return sizes["width"] * sizes["thickness"]
    if "frozen_diameter" in sizes:
        frozen = _need(sizes, "frozen_height", "the frozen volume into an area", place)
        return rig.thawed_area(sizes["frozen_diameter"] / 2, frozen, _need(sizes, "height", "volume into area", place))
    if "diameter" in sizes:
        return convert.disc_area(sizes["diameter"])
    expected = "area, diameter, width and thickness, or frozen_diameter and frozen_height, to turn force into stress"
    raise checks.refusal(place, "specimen", f"{', '.join(sizes) or 'nothing'}", expected)


def _stress(
    values: np.ndarray, kind: str, motion: np.ndarray, area: float | None, part: Part, place: str
) -> tuple[np.ndarray, float]:
    """Nominal stress, and what one unit of the measured quantity is in it (for noise); a force comes with its area."""
    if values.ndim != motion.ndim:
        raise checks.refusal(place, "columns", f"{values.ndim} axes of {kind}", f"{motion.ndim}, as of the deformation")
    if area is not None:
        return convert.nominal_from_force(values, area), 1.0 / area
    # In simple shear the shear components of Cauchy and nominal stress are the same: P12 = sigma12.
    if kind == "true_stress" and part.experiment != "simple-shear":
        return convert.nominal_from_true(values, motion), float(np.sqrt(np.mean(motion**-2.0)))
    return values, 1.0


def _said(stated: str | Column, quantity_name: str, columns: Columns, rows: np.ndarray) -> float:
    """A noise level as the side file gives it, SI; the quadratic mean of a column."""
    si = QUANTITIES[quantity_name]
    if isinstance(stated, Column):
        values = columns.numbers(stated.column)[rows] * factor(stated.unit, si)
        return float(np.sqrt(np.nanmean(values**2)))
    return quantity(stated, si)


def _noise(
    part: Part, load: str, columns: Columns, rows: np.ndarray, per_unit: float, abscissa: np.ndarray, stress: np.ndarray
) -> float | None:
    others = [q for q in part.noise if q in STRESS and q not in (load, "nominal_stress")]
    if others:
        raise InputError(f"noise.{others[0]}: the load column is {load}: give noise.{load} or noise.nominal_stress")
    for q, scale in ((load, per_unit), ("nominal_stress", 1.0)):
        if part.noise.get(q, "estimate") != "estimate":
            return _said(part.noise[q], q, columns, rows) * scale
    return convert.noise_of(abscissa, stress)


def _slope(values: np.ndarray, motion: np.ndarray, kind: str, sizes: Sizes) -> float:
    """Quadratic mean of d(stretch)/d(measured), to carry noise over."""
    slopes = {
        "displacement": lambda: 1.0 / sizes["height"],
        "length": lambda: 1.0 / sizes.get("height", np.ravel(values)[0]),
        "true_strain": lambda: motion,
        "radial_stretch": lambda: 2.0 / values**3,
        "angle": lambda: 1.0 + motion**2,
    }
    return float(np.sqrt(np.mean(np.square(slopes.get(kind, lambda: 1.0)()))))


def _probing(
    part: Part,
    time: np.ndarray,
    values: Mapping[str, np.ndarray],
    kinematic: str,
    load: str,
    sizes: Sizes,
    name: str,
    place: str,
    attributes: dict[str, float | np.ndarray],
) -> Recording:
    """A tip pressed straight down: displacement into the sample and the force that pushes back, both positive.

    The tip's centre starts at height + radius (height 0 where unknown): touching at zero displacement.
    """
    if (kinematic, load) != ("displacement", "force"):
        expected = "displacement and force in a probing test"
        raise checks.refusal(place, f"columns for {part.experiment}", f"{kinematic} and {load}", expected)
    radius = _need(sizes, "radius", "displacement into the tip's position", place)
    position = np.zeros((len(time), 3))
    position[:, 2] = sizes.get("height", 0.0) + radius - values["displacement"]
    force = np.zeros((len(time), 3))
    force[:, 2] = values["force"]
    stated = part.noise.get("force", "estimate")
    noise = convert.noise_of(time, values["force"]) if stated == "estimate" else quantity(stated, "N")
    inputs = {"probe/time": time, "probe/position": position}
    channel = Channel(time, force, "N", noise)
    return Recording(name, "probing", inputs, {"force": channel}, attributes | {"probe/radius": radius})
