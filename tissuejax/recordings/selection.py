"""Which part of a test is kept: cycles, loading or unloading, up to failure, from a preload on, without slack.

    cycles  = "last"          # or "first", 3, "3-5", "after 5"; a cycle goes from rest to the peak and back
    phase   = "loading"       # or "unloading"
    upto    = "peak"          # up to the largest load; or "first drop", up to where the load first falls by a tenth
    preload = "0.02 N"        # the test begins, and deformation counts, where the load first reaches this
    toe     = ["0.1 N", "0.5 N"]  # slack: the line through this range of load meets zero load where deformation counts

They are carried out in the order upto, cycles, phase, preload, toe. In soft tissue the curved beginning is the tissue
itself, crimped fibres that straighten: take it off with `toe` only if it is slack of grips or thread.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from tissuejax.errors import InputError
from tissuejax.units import quantity

HYSTERESIS = 0.1  # of the whole range: a turn smaller than that is noise, not the end of a cycle
NEAR = 0.005  # of a cycle's range: this near to the peak counts as arrived, so that a noisy hold is not loading
DROP = 0.1  # of the largest load so far: a fall that means the specimen broke


@dataclass(frozen=True)
class Selection:
    """What a side file says about the part that is kept; None or "" where it says nothing.

    Attributes:
        cycles: (first, last) counted from 1, negative from the end; last may be None for "to the end".
        phase: "loading" or "unloading".
        upto: "peak" or "first drop".
        preload: text with a unit.
        toe: two texts with units.
    """

    cycles: tuple[int, int | None] | None = None
    phase: str = ""
    upto: str = ""
    preload: str = ""
    toe: tuple[str, str] | None = None

    def __bool__(self) -> bool:
        return self != Selection()


def selection_from(table: Mapping[str, object]) -> Selection:
    """The keys of a side file's part.

    Raises:
        InputError: a value that is none of the allowed.
    """
    phase, upto = table.get("phase", ""), table.get("upto", "")
    if phase not in ("", "loading", "unloading"):
        raise InputError(f"phase: found {phase!r}, expected 'loading' or 'unloading'")
    if upto not in ("", "peak", "first drop"):
        raise InputError(f"upto: found {upto!r}, expected 'peak' or 'first drop'")
    preload, toe = table.get("preload", ""), table.get("toe")
    if not isinstance(preload, str):
        raise InputError(f'preload: found {preload!r}, expected a load with its unit, such as "0.02 N"')
    if toe is not None and not (isinstance(toe, list) and len(toe) == 2 and all(isinstance(t, str) for t in toe)):
        raise InputError(f'toe: found {toe!r}, expected two loads with units, such as ["0.1 N", "0.5 N"]')
    return Selection(_cycles(table.get("cycles")), phase, upto, preload, tuple(toe) if toe else None)


def _cycles(value: object) -> tuple[int, int | None] | None:
    if value is None:
        return None
    if isinstance(value, int) and not isinstance(value, bool) and value >= 1:
        return value, value
    text = str(value).strip().lower()
    if text in ("last", "first"):
        return (-1, -1) if text == "last" else (1, 1)
    found = re.fullmatch(r"(\d+)\s*-\s*(\d+)", text)
    if found and 1 <= int(found[1]) <= int(found[2]):
        return int(found[1]), int(found[2])
    found = re.fullmatch(r"after\s+(\d+)", text)
    if found:
        return int(found[1]) + 1, None
    raise InputError(f"cycles: found {value!r}, expected 'last', 'first', a number from 1, '3-5' or 'after 5'")


def turns(motion: Float[np.ndarray, " n"], hysteresis: float = HYSTERESIS) -> Int[np.ndarray, " k"]:
    """Indices where a motion turns round, the first and last sample included: rest, peak, rest, peak, ...

    A turn counts once the motion has gone back by `hysteresis` times its whole range. The first stretch is taken to
    lead away from rest.
    """
    least = hysteresis * float(np.ptp(motion))
    if least == 0 or len(motion) < 3:
        return np.array([0, len(motion) - 1])
    found, extreme = [0], 0
    sense = 0.0
    for i, value in enumerate(motion):
        if sense == 0:
            if abs(value - motion[0]) >= least:
                sense, extreme = float(np.sign(value - motion[0])), i
        elif sense * (value - motion[extreme]) >= 0:
            extreme = i
        elif sense * (motion[extreme] - value) >= least:
            found.append(extreme)
            sense, extreme = -sense, i
    # What comes after the last peak or valley goes back by less than a turn: a hold, or rest.
    return np.array(
        [*found, len(motion) - 1] if extreme != found[-1] or len(found) == 1 else [*found[:-1], len(motion) - 1]
    )


def chosen(
    selection: Selection, motion: Float[np.ndarray, "n ..."], load: Float[np.ndarray, "n ..."], place: str
) -> tuple[Bool[np.ndarray, " n"], list[str]]:
    """The rows that `upto`, `cycles` and `phase` keep, and sentences on what was left out.

    Args:
        selection: what was asked for.
        motion, load: as measured; of a biaxial test the first axis counts.
        place: for messages.

    Raises:
        InputError: a cycle that isn't there, or fewer than two rows left.
    """
    x, y = motion.reshape(len(motion), -1)[:, 0], np.abs(load.reshape(len(load), -1)[:, 0])
    keep, notes = np.ones(len(x), bool), []
    if selection.upto:
        end = int(np.argmax(y))
        if selection.upto == "first drop":
            so_far = np.maximum.accumulate(y)
            falls = np.flatnonzero((so_far - y > DROP * so_far) & (so_far > DROP * y.max()))
            end = int(np.argmax(y[: falls[0] + 1])) if len(falls) else len(y) - 1
        keep[end + 1 :] = False
        notes.append(f"Kept up to the {'peak' if selection.upto == 'peak' else 'first drop'} of the load.")
    if selection.cycles is not None or selection.phase:
        inside = np.flatnonzero(keep)
        corners = turns(x[inside])
        cycles = [tuple(corners[k : k + 3]) for k in range(0, len(corners) - 1, 2)]
        first, last = selection.cycles or (1, None)
        first = len(cycles) + 1 + first if first < 0 else first
        last = len(cycles) if last is None else (len(cycles) + 1 + last if last < 0 else last)
        if not 1 <= first <= last <= len(cycles):
            raise InputError(
                f"{place}: cycles: {_asked(selection.cycles)} wanted, found {len(cycles)} cycle(s) in the deformation; "
                "change `cycles`, or pick rows with `where` if the table counts cycles itself"
            )
        mask = np.zeros(len(inside), bool)
        for cycle in cycles[first - 1 : last]:
            mask |= _phase(x[inside], cycle, selection.phase)
        if selection.cycles is not None:
            notes.append(f"Cycle {first}{f' to {last}' if last != first else ''} of {len(cycles)} kept.")
        if first > 1:
            notes.append("What the tissue remembers of the cycles before is not in the recording.")
        if selection.phase:
            notes.append(f"The {selection.phase} alone is kept.")
        keep[inside[~mask]] = False
    if keep.sum() < 2:
        raise InputError(
            f"{place}: {int(keep.sum())} row(s) left by upto, cycles and phase, expected at least 2 to be "
            "looked at, and 3 to be fitted"
        )
    return keep, notes


def _asked(cycles: tuple[int, int | None] | None) -> str:
    """What `cycles` asks for, in words."""
    first, last = cycles or (1, None)
    if first < 0:
        return "the last cycle"
    if last is None:
        return f"cycle {first} and those after it"
    return f"cycle {first}" if first == last else f"cycles {first} to {last}"


def _phase(x: np.ndarray, cycle: tuple[int, ...], phase: str) -> np.ndarray:
    """Rows of one cycle (rest, peak, and rest again where it came back)."""
    mask = np.zeros(len(x), bool)
    begin, peak, end = cycle[0], cycle[1], cycle[-1]
    if not phase:
        mask[begin : end + 1] = True
        return mask
    near = np.abs(x[begin : end + 1] - x[peak]) <= NEAR * abs(x[peak] - x[begin])
    arrived, left = begin + np.flatnonzero(near)[[0, -1]]
    if phase == "loading":
        mask[begin : max(arrived, begin + 1) + 1] = True
    else:
        mask[left : end + 1] = True
    return mask


def start_of(
    selection: Selection,
    motion: Float[np.ndarray, " n"],
    load: Float[np.ndarray, " n"],
    place: str,
    unit: str,
) -> tuple[int, float, list[str]]:
    """First row kept, and the reading of the deformation that counts as none.

    Args:
        selection: what was asked for.
        motion, load: of the rows kept so far.
        place: for messages.
        unit: SI, of `load`.

    Raises:
        InputError: a preload that is never reached, or a toe range with fewer than three rows or no slope.
    """
    size, first, zero, notes = np.abs(load), 0, 0.0, []
    if selection.preload:
        preload = quantity(selection.preload, unit, "preload")
        over = np.flatnonzero(size >= preload)
        if not len(over):
            raise InputError(
                f"{place}: preload: {selection.preload} is never reached, the largest load is {size.max():.4g} {unit}; "
                "give a smaller one, or check the unit of the load's column"
            )
        first = int(over[0])
        zero = float(motion[first])
        if first:
            share = (preload - size[first - 1]) / (size[first] - size[first - 1])
            zero = float(motion[first - 1] + share * (motion[first] - motion[first - 1]))
        notes.append(
            f"Deformation counts from the preload of {selection.preload}; {first} rows before it are left out."
        )
    if selection.toe is not None:
        low, high = sorted(quantity(t, unit, "toe") for t in selection.toe)
        end = int(np.argmax(size)) + 1
        inside = np.flatnonzero((size[:end] >= low) & (size[:end] <= high))
        if len(inside) < 3:
            raise InputError(f"{place}: toe: {len(inside)} row(s) between the two loads, expected at least 3; widen it")
        slope, offset = np.polyfit(motion[inside], load[inside], 1)
        if slope == 0:
            raise InputError(f"{place}: toe: the load doesn't change between {selection.toe}; take another range")
        zero = float(-offset / slope)
        gone = np.sign(motion[inside[-1]] - zero) * (motion - zero) >= 0
        first = max(first, int(np.argmax(gone)))
        notes.append(f"Slack taken off: the line between {' and '.join(selection.toe)} meets zero load there.")
    return first, zero, notes
