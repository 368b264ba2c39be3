"""Which candidates these recordings can speak of: none that needs what their protocol hasn't done.

What a protocol can't show must not be named from it: whatever is then fitted bends to something else. Every effect
says what it needs (`Effect.needs`), a property of the protocol, which is asked of the protocol alone, before anything
is fitted; a clock is needed by all that acts in time (`untimed`).
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.judgement.particular import SHOWN, Shown
from tissuejax.diagnosis.untimed import without_clock, without_pace
from tissuejax.effects.catalogue import needs
from tissuejax.recordings.recording import Recording, Sample


@dataclass(frozen=True)
class Protocol:
    """What was done to a sample.

    Attributes:
        kinds: of experiments.
        reversed: some recording comes back over strains that it has passed. Before that the stress is a function of
            strain for whatever remembers the way (set, softening, hysteresis), so it is another strain energy.
        rates: some recording holds or unloads, or recordings differ in rate.
        times: recordings begin at different times of the session.
        directions: specimens are loaded along several directions.
        sides: pulled and pressed.
        sizes: specimens differ in size.
        repeated: some strains were passed by several recordings. Where each goes a way of its own, a stiffness of
            each recording's own is a law that fails to carry from one strain to another.

    Derived: `constraints` (some test holds what a change of volume would move), `unlike` (specimens or modes that the
    same rig loads unlike).
    """

    kinds: frozenset[str]
    reversed: bool
    rates: bool
    times: bool
    directions: bool
    sides: bool
    sizes: bool
    repeated: bool

    @property
    def constraints(self) -> bool:
        """Whether some test is neither uniaxial nor simple shear."""
        return not self.kinds <= {"uniaxial", "simple-shear"}

    @property
    def unlike(self) -> bool:
        """Whether modes, senses or sizes differ."""
        return len(self.kinds) > 1 or self.sides or self.sizes

    @classmethod
    def of(cls, sample: Sample, shown: Shown = SHOWN) -> "Protocol":
        """The protocol of a sample of material tests."""
        recordings = list(sample.recordings.values())
        drives = [d for r in recordings for d in driven(r)]
        moves = [motion(t, x, shown) for t, x in drives]
        quick = [m[1] for m in moves if m[1] > 0]
        directions = {direction(r) for r in recordings}
        kinds = frozenset(r.experiment for r in recordings)
        back = any(m[0] for m in moves)
        return cls(
            kinds=kinds,
            reversed=back,
            rates=back or any(m[2] for m in moves) or (bool(quick) and max(quick) > shown.rates * min(quick)),
            times=len({float(r.attributes.get("start", 0.0)) for r in recordings}) > 1,
            directions=len(directions) > 1 or "biaxial" in kinds,
            sides=all(any(np.max(sign * x) > shown.sides for _, x in drives) for sign in (-1, 1)),
            sizes=len({(r.attributes.get("area"), r.attributes.get("height")) for r in recordings}) > 1,
            repeated=any(
                overlap(a, b, shown) > shown.shared for a, b in itertools.permutations(recordings, 2) if alike(a, b)
            ),
        )


def direction(r: Recording) -> tuple[float, ...]:
    """Which it is loaded along."""
    return tuple(np.round(np.asarray(r.attributes.get("direction", (0, 0, 0)), float), 6))


def alike(a: Recording, b: Recording) -> bool:
    """Whether two recordings are one kind of test, sheared at one axial stretch.

    Along whichever direction: a law without fibres says the same of all, and then it is another for each strip.
    """
    axial = [float(r.attributes.get("axial_stretch", 1.0)) for r in (a, b)]
    return a.experiment == b.experiment and abs(axial[0] - axial[1]) < 1e-6


def overlap(a: Recording, b: Recording, shown: Shown = SHOWN) -> float:
    """Share of the samples of `a`, those near rest left out, whose strain `b` passes too."""
    one, other = (np.stack([x for _, x in driven(r)], axis=1) for r in (a, b))
    one, other = (x[np.unique(np.linspace(0, len(x) - 1, shown.points).astype(int))] for x in (one, other))
    near = shown.near * float(np.max(np.abs(np.concatenate([one, other]))))
    one = one[np.linalg.norm(one, axis=1) > near]
    apart = np.min(np.linalg.norm(one[:, None] - other[None], axis=-1), axis=1) if len(one) else np.zeros(0)
    return float(np.mean(apart <= near)) if len(apart) else 0.0


def driven(r: Recording) -> list[tuple[np.ndarray, np.ndarray]]:
    """Time and strain along every driven direction."""
    name = "shear" if "shear" in r.inputs else "stretch"
    x = np.asarray(r.inputs[name], float).reshape(len(r.inputs["time"]), -1)
    return [
        (np.asarray(r.inputs["time"], float), x[:, i] if name == "shear" else np.log(x[:, i]))
        for i in range(x.shape[1])
    ]


def motion(time: np.ndarray, x: np.ndarray, shown: Shown = SHOWN) -> tuple[bool, float, bool]:
    """Whether it comes back, its quickest sustained rate, and whether it is held.

    A pull that only goes slower for a while is not held: its time is a function of the strain, as that of any pull.
    """
    span = float(np.ptp(x)) or 1.0
    back = max(float(np.max(np.maximum.accumulate(side) - side)) for side in (x, -x))
    way = max(float(np.max(side) - side[0]) for side in (x, -x))
    turns = min(back, way) > shown.back * span and float(np.sum(np.abs(np.diff(x)))) > (1 + 2 * shown.back) * abs(
        x[-1] - x[0]
    )
    rate = np.abs(np.diff(x)) / np.maximum(np.diff(time), 1e-12)
    quick = float(np.quantile(rate, shown.quick)) if len(rate) else 0.0
    path = np.interp(np.linspace(time[0], time[-1], shown.points), time, x)
    moved = np.ptp(sliding_window_view(path, int(shown.held * shown.points) + 1), axis=1)
    return turns, quick, float(np.min(moved)) <= shown.still * span


def paced(sample: Sample, shown: Shown = SHOWN) -> bool:
    """Whether time was recorded and is more than a function of the strain: several rates, or holds."""
    return sample.timed and Protocol.of(sample, shown).rates


LACKING: Mapping[str, str] = {  # property of a protocol: what is said where it is not there
    "times": "recordings carry no times of their own in the session (`start`)",
    "directions": "all recordings load one direction",
    "constraints": "uniaxial and shear tests alone don't show a change of volume",
    "unlike": "one specimen in one mode can't tell the rig's compliance from the tissue's",
    "reversed": "nothing is unloaded",
    "rates": "ramps at one rate, without holds",
    "repeated": "no strain was passed by several recordings",
}


def offered(
    sample: Sample,
    candidates: Mapping[str, Candidate],
    names: Sequence[str] | None = None,
    shown: Shown = SHOWN,
) -> tuple[dict[str, Candidate], list[str]]:
    """Candidates that the sample's recordings can show, and remarks on what was left out.

    Args:
        names: effects asked for; all by default.
        shown: from when on a protocol shows something.
    """
    kept, remarks = dict(candidates), []
    if not sample.timed:
        kept = without_clock(kept)
        remarks.append("no time was recorded: effects that act in time (relaxation, drift, aging) were not tried")
    protocol = Protocol.of(sample, shown)
    if not protocol.rates:
        kept = without_pace(kept)
    kept, left_out = speaking(widened(kept, protocol, names), protocol, needs("homogeneous"), LACKING)
    return kept, remarks + left_out


def widened(
    candidates: Mapping[str, Candidate], protocol: object, names: Sequence[str] | None = None
) -> dict[str, Candidate]:
    """The candidates, those that only widen the discrepancy behind the others, the widest first.

    They have no linear step to be ranked by, and what may be largest sets the mark below which others are given up.

    Args:
        protocol: whose properties say what they widen too (`Form.lacking`).
        names: effects asked for; all by default.
    """
    own = {k: c for k, c in candidates.items() if c.widens and (names is None or c.name in names)}
    for key, c in own.items():
        more = [families for need, families in c.lacking.items() if not getattr(protocol, need)]
        own[key] = replace(c, widens={f: w for families in (c.widens, *more) for f, w in families.items()})
    order = sorted(own, key=lambda k: (-max(own[k].widens.values()), bool(own[k].form)))
    return {k: c for k, c in candidates.items() if not c.widens} | {k: own[k] for k in order}


def speaking(
    candidates: Mapping[str, Candidate], protocol: object, needed: Mapping[str, str], lacking: Mapping[str, str]
) -> tuple[dict[str, Candidate], list[str]]:
    """Candidates that a protocol can show, and remarks on the others.

    Args:
        protocol: of the recordings, whatever their kind.
        needed: by name of an effect, the property that it needs (`effects.catalogue.needs`).
        lacking: by property, what is said where it is not there.
    """
    why: dict[str, list[str]] = {}
    kept = dict(candidates)
    for name, need in sorted(needed.items()):
        if any(c.name == name for c in kept.values()) and not getattr(protocol, need):
            kept = {k: c for k, c in kept.items() if c.name != name}
            why.setdefault(lacking[need], []).append(name)
    return kept, [
        f"{', '.join(left)} can't be told from these recordings and was not tried: {r}" for r, left in why.items()
    ]
