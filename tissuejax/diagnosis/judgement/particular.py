"""Numbers of the judgement that belong to one step or one kind of recordings: unit, meaning and ground of each.

Fields of `Criteria`, so that all numbers are reached from there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Shown:
    """From when on a protocol shows something (`diagnosis.offered`).

    Attributes:
        back: way back that is an unloading, share of the range of strain. Ground: a machine overshoots by less.
        still: strain by which a specimen that is held still moves, share of its range. Ground: controllers hunt and
            grips creep by less.
        rates: ratio from which two rates are two. Ground: rates of a series are decades or at least twice apart;
            machines keep one to a tenth.
        near: strains closer than this are one, share of the largest. Ground: what a gauge length is known to.
        shared: samples whose strain another recording passes too, from where on the two are repeats, share of a
            recording. Ground: more than not.
        points: of a recording's path that are compared, at most. Ground: cost; ten within `near`.
        held: a shorter hold is none, share of a recording's time. Ground: a machine stops for less where it turns.
        quick: quantile of the rates that is a recording's quickest sustained one. Ground: without its jolts.
        sides: strain from which a specimen is pulled or pressed. Ground: a tenth of a per cent is slack.
        readings: of a probe's force from which on a hum can be sought. Ground: four in each of five periods, so that
            there is a range of frequencies that it may lie in.
    """

    back: float = 0.05
    still: float = 0.005
    rates: float = 1.5
    near: float = 0.05
    shared: float = 0.5
    points: int = 200
    held: float = 0.05
    quick: float = 0.9
    sides: float = 1e-3
    readings: int = 20


@dataclass(frozen=True)
class Means:
    """Into how many means of samples measurements are taken together (`judgement.blocks`).

    Attributes:
        whole: means of a sample, shared by its series. Ground: cost, which grows with the cube.
        least, most: means of a series. Ground: a curve, its toe and its hold are told by thirty; by more than a
            hundred nothing smooth is told better.
        knots: pieces of a series between whose means the stress's way is measured. Ground: noise has a way too, and
            none that tells of anything.
        peak: quantile of the stress (its size) that is a recording's typical largest. Ground: one sample in fifty may
            be a spike.
    """

    whole: int = 480
    least: int = 30
    most: int = 100
    knots: int = 60
    peak: float = 0.98


@dataclass(frozen=True)
class Simulated:
    """What holds where every prediction is a simulation (`diagnosis.probing_view`, `probing_slopes`).

    Attributes:
        means: means of samples of a series, by channel. Ground: markers are many and calm.
        reach: relative change of the prediction up to which a derivative is taken from nearby. Ground: cost; columns
            change in proportion to the prediction.
        sharp: the same of derivatives that errors are taken from. Ground: as `reach`, and fewer are needed.
        stays: relative change of the prediction up to which a correction stays, while the base is fitted. Ground: the
            correction changes in proportion to what it corrects.
        common: the same about the base's fit. Ground: one correction for all sets leaves its own errors (meshes ring, a
            few nats' worth) out of their comparison.
        far: change from where on a correction says nothing. Ground: in p03 a support that moves, its inertia at twice
            the speed uncorrected, drove moduli to twice their size (change 0.85; a late clock 0.05).
        remains: of the change from the coarse to the fine mesh, what the fine one leaves open. Ground: 12 x 12 x 5 to
            22 x 22 x 8 elements are 1.75 times finer: 1 / (1.75^2 - 1).
        late, open: of the change from twice the speed, what is taken out and what is left open. Ground: 1 / (2^p - 1)
            is 1 or a third for order p = 1 (damping) and 2 (inertia): the middle, and the half way to both.
        calmed: samples over which a rate is smoothed. Ground: so that it doesn't ring.
        shape: by how much a shape's logarithm, a shape in its scale, or an amplitude in its size may have moved where a
            derivative of its effect is used again. Ground: cost; in that range a column changes by some tenths.
        touching: share of the depth up to which a shift of the surface is no small part of it. Ground: facets.
        steep: power of the depth that a force goes by. Ground: of a ball on an elastic body, Hertz 1881.
        early, fewest: a marker's place at rest is the median of the first of so many equal shares of its frames, of
            so many frames at least. Ground: a press begins later.
        knots: depths between which what is smooth in depth is read off. Ground: cost; ten in its shortest length.
    """

    means: Mapping[str, int] = field(default_factory=lambda: {"force": 80, "markers": 16})
    reach: float = 0.03
    sharp: float = 0.01
    stays: float = 0.03
    common: float = 0.15
    far: float = 0.4
    remains: float = 0.48
    late: float = 2 / 3
    open: float = 1 / 3
    calmed: float = 3.0
    shape: float = 0.25
    touching: float = 0.05
    steep: float = 1.5
    early: int = 10
    fewest: int = 5
    knots: int = 60


@dataclass(frozen=True)
class Strokes:
    """What any model leaves of a blade's strokes (`diagnosis.cutting_discrepancy`).

    Attributes:
        place: correlation length along the way, share of the longest; the finer one is that of a law. Ground: tissue
            changes along a stroke a few times.
        entry: m: twice the length over which a force sets in. Ground: faces part over some millimetres.
        peak: bevels over which the entry's peak is over. Ground: a shoulder is a fraction of its bevel.
        wander: of what wanders in material tests. Ground: a cut is over in a minute, and a zero that goes farther is a
            drift.
        knots: places between which what is smooth along the way is read off. Ground: cost.
    """

    place: float = 0.4
    entry: float = 4e-3
    peak: float = 0.25
    wander: float = 0.3
    knots: int = 60


SHOWN, MEANS, SIMULATED, STROKES = Shown(), Means(), Simulated(), Strokes()
