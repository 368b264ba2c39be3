"""Which candidates these recordings can speak of: none that its own page (`Effect.blind`) calls them blind to.

What a protocol can't show must not be named from it: whatever is then fitted bends to something else. Asked of the
protocol alone, before anything is fitted; a clock is needed by all that acts in time (`untimed`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.untimed import timed, without_clock
from tissuejax.recordings.recording import Recording, Sample

SCATTER = Candidate("specimen-scatter", (), widens={"gain": 0.3})
HYSTERESIS = Candidate("hysteresis", (), widens={"hysteresis": 0.15})
BACK = 0.05  # of the range of stretch: less of a way back is no unloading
STILL = 0.05  # of the quickest rate: slower is a hold
RATES = 1.5  # ratio from which two rates are two
HELD = 0.05  # of a recording's time: a shorter hold is none


@dataclass(frozen=True)
class Protocol:
    """What was done to a sample.

    Attributes:
        kinds: of experiments.
        reversed: some recording unloads.
        rates: some recording holds or unloads, or recordings differ in rate.
        times: recordings begin at different times of the session.
        directions: specimens are loaded along several directions.
        sides: pulled and pressed.
        sizes: specimens differ in size.
        several: there are several recordings.
    """

    kinds: frozenset[str]
    reversed: bool
    rates: bool
    times: bool
    directions: bool
    sides: bool
    sizes: bool
    several: bool

    @classmethod
    def of(cls, sample: Sample) -> "Protocol":
        """The protocol of a sample of material tests."""
        recordings = list(sample.recordings.values())
        drives = [d for r in recordings for d in driven(r)]
        moves = [motion(t, x) for t, x in drives]
        quick = [m[1] for m in moves if m[1] > 0]
        directions = {
            tuple(np.round(np.asarray(r.attributes.get("direction", (0, 0, 0)), float), 6)) for r in recordings
        }
        kinds = frozenset(r.experiment for r in recordings)
        back = any(m[0] for m in moves)
        return cls(
            kinds=kinds,
            reversed=back,
            rates=back or any(m[2] for m in moves) or (bool(quick) and max(quick) > RATES * min(quick)),
            times=len({float(r.attributes.get("start", 0.0)) for r in recordings}) > 1,
            directions=len(directions) > 1 or "biaxial" in kinds,
            sides=any(np.min(x) < -1e-3 for _, x in drives) and any(np.max(x) > 1e-3 for _, x in drives),
            sizes=len({(r.attributes.get("area"), r.attributes.get("height")) for r in recordings}) > 1,
            several=len(recordings) > 1,
        )


def driven(r: Recording) -> list[tuple[np.ndarray, np.ndarray]]:
    """Time and strain along every driven direction."""
    name = "shear" if "shear" in r.inputs else "stretch"
    x = np.asarray(r.inputs[name], float).reshape(len(r.inputs["time"]), -1)
    return [
        (np.asarray(r.inputs["time"], float), x[:, i] if name == "shear" else np.log(x[:, i]))
        for i in range(x.shape[1])
    ]


def motion(time: np.ndarray, x: np.ndarray) -> tuple[bool, float, bool]:
    """Whether it comes back, its quickest sustained rate, and whether it is held."""
    span = float(np.ptp(x)) or 1.0
    back = max(float(np.max(np.maximum.accumulate(side) - side)) for side in (x, -x))
    way = max(float(np.max(side) - side[0]) for side in (x, -x))
    turns = min(back, way) > BACK * span and float(np.sum(np.abs(np.diff(x)))) > (1 + 2 * BACK) * abs(x[-1] - x[0])
    rate = np.abs(np.diff(x)) / np.maximum(np.diff(time), 1e-12)
    quick = float(np.quantile(rate, 0.9)) if len(rate) else 0.0
    still = float(np.sum(np.diff(time)[rate < STILL * float(np.max(rate, initial=0.0))]))
    return turns, quick, still > HELD * float(np.ptp(time))


NEEDS: Mapping[str, tuple[Callable[[Protocol], bool], str]] = {
    "aging": (lambda p: p.times, "recordings carry no times of their own in the session (`start`)"),
    "anisotropy": (lambda p: p.directions, "all recordings load one direction"),
    "compressibility": (
        lambda p: not p.kinds <= {"uniaxial", "simple-shear"},
        "uniaxial and shear tests alone don't show a change of volume",
    ),
    "machine-compliance": (
        lambda p: len(p.kinds) > 1 or p.sides or p.sizes,
        "one specimen in one mode can't tell the rig's compliance from the tissue's",
    ),
    "permanent-set": (lambda p: p.reversed, "nothing is unloaded"),
    "softening": (lambda p: p.reversed, "nothing is unloaded"),
    "hysteresis": (lambda p: p.reversed, "nothing is unloaded"),
    "viscoelasticity": (lambda p: p.rates, "ramps at one rate, without holds"),
    "specimen-scatter": (lambda p: p.several, "there is one recording"),
}


def offered(
    sample: Sample, candidates: Mapping[str, Candidate], names: tuple[str, ...] | None = None
) -> tuple[dict[str, Candidate], list[str]]:
    """Candidates that the sample's recordings can show, and remarks on what was left out.

    Two are added that have no parameters but let a part of the discrepancy be large: a stiffness and a law of each
    recording's own (specimens that differ, or a gain that changed: stress and stretch can't tell), and a
    rate-independent hysteresis.

    Args:
        names: effects asked for; all by default.
    """
    kept, remarks = dict(candidates), []
    if not timed(sample):
        kept = without_clock(kept)
        remarks.append("no time was recorded: effects that act in time (relaxation, drift, aging) were not tried")
    for own in (SCATTER, HYSTERESIS):
        if names is None or own.name in names:
            kept[own.key] = own
    protocol, why = Protocol.of(sample), {}
    for name, (shown, reason) in NEEDS.items():
        if any(c.name == name for c in kept.values()) and not shown(protocol):
            kept = {k: c for k, c in kept.items() if c.name != name}
            why.setdefault(reason, []).append(name)
    remarks += [
        f"{', '.join(left)} can't be told from these recordings and was not tried: {r}" for r, left in why.items()
    ]
    return kept, remarks
