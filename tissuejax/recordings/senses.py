"""The sense of what a table holds: which way load and deformation count, and where they start from."""

from collections.abc import Mapping, Sequence

import numpy as np

from tissuejax.recordings.columns_guessed import Guessed

Pairs = Sequence[tuple[Sequence[Guessed], str]]


def signs_of(
    pairs: Pairs, numbers: Mapping[str, np.ndarray], experiment: str, positive: str, pressed: bool
) -> tuple[dict[str, int], str, list[str]]:
    """Sign of each column that is turned round, which sense counts positive, and what was assumed.

    Args:
        pairs: deformation and load of each recording; the first one tells.
        numbers: the columns.
        experiment: the kind of test.
        positive: where the user says it.
        pressed: whether the file speaks of compression.
    """
    if experiment == "cutting":  # its place and its force are read as they stand, either sign
        return {}, "tension", []
    pair = pairs[0][0]
    motion, load = pair[0], pair[len(pair) // 2]
    x, y = numbers[motion.column], numbers[load.column]
    both = np.isfinite(x) & np.isfinite(y)
    if not both.any():
        return {}, positive or "tension", []
    x, y = x[both], y[both]
    if (
        not positive
        and experiment in ("uniaxial", "planar", "equibiaxial")
        and motion.quantity in ("stretch", "length")
    ):
        most = int(np.argmax(np.abs(y - y[0])))
        if x[most] < x[0] and y[most] > y[0]:
            said = f"{load.column!r} rises as the specimen shortens: compression counts positive"
            return {}, "compression", [said]
    told = positive or experiment == "simple-shear" or motion.quantity in ("stretch", "length")
    if told and experiment != "probing":
        return {}, positive or "tension", []
    if still := [g.column for g, values in ((motion, x), (load, y)) if not np.ptp(values)]:
        which = f"{' and '.join(map(repr, still))} {'do' if len(still) > 1 else 'does'} not change"
        sense = "compression" if pressed and experiment != "probing" else "tension"
        counts = "it is read as it stands" if experiment == "probing" else f"{sense} counts positive"
        return {}, sense, [f"the sense of the load can't be told, because {which}: {counts}"]
    most = int(np.argmax(np.abs(y - y[0])))
    dx, dy = float(np.sign(x[most] - x[0])), float(np.sign(y[most] - y[0]))
    if experiment == "probing":
        signs = {g.column: -1 for g, s in ((motion, dx), (load, dy)) if s < 0}
        return (
            signs,
            "tension",
            [f"{', '.join(map(repr, signs))} falls as the tip goes in: turned round"] if signs else [],
        )
    if dx * dy < 0:
        return (
            {motion.column: -1},
            "tension",
            [f"load and deformation have opposite signs: {motion.column!r} is turned round, to go with the load"],
        )
    if dx >= 0 and pressed:
        return {}, "compression", ["the file speaks of compression and its numbers rise: compression counts positive"]
    if dx == 0:
        said = (
            f"the sense of the load can't be told, because {motion.column!r} is where it began when the load is largest"
        )
        return {}, "tension", [f"{said}: tension counts positive"]
    if dx > 0 and experiment == "uniaxial":
        return (
            {},
            "tension",
            ["load and deformation rise together: taken as tension (--positive compression if pressed)"],
        )
    if dx > 0:
        return {}, "tension", ["load and deformation rise together: taken as tension"]
    return {}, "tension", ["load and deformation fall together: taken as compression, which counts negative"]


def zeros_of(pairs: Pairs, numbers: Mapping[str, np.ndarray], experiment: str) -> tuple[tuple[str, ...], list[str]]:
    """Displacements that don't start at zero and are counted from their first sample, and what is said of the start."""
    found: list[str] = []
    said: list[str] = []
    for pair, _ in pairs if experiment != "cutting" else ():
        for guess in pair:
            values = numbers[guess.column][np.isfinite(numbers[guess.column])]
            if guess.quantity not in ("displacement", "force") or not len(values) or not np.ptp(values):
                continue
            share = abs(values[0]) / np.ptp(values)
            if guess.quantity == "displacement" and share > 0.01 and experiment != "probing":
                found.append(guess.column)
                said.append(f"{guess.column!r} starts at {values[0]:.4g} {guess.unit}: counted from there")
            elif guess.quantity == "force" and share > 0.05 and experiment != "probing":
                said.append(
                    f"{guess.column!r} starts at {values[0]:.4g} {guess.unit}, not at zero: a preload, or an offset of "
                    "the cell (then: zero = true in its line)"
                )
    return tuple(dict.fromkeys(found)), said
