"""How much is tried and how far each set is followed: the numbers of the search, with unit, meaning and ground."""

import math
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Course:
    """How far the fit of one set is followed.

    Attributes:
        rounds: of fit and amplitudes in turn, at most. Ground: cost; few sets gain `settled` in a fourth.
        iterations: of the fit in a round, at most. Ground: cost.
        first, later: chi-square that a step of a fit has to promise, in the first round and in later ones (of costly
            predictions that of the first). Ground: half a unit changes no evidence by more than a quarter of a nat.
        settled: nats: a round that gains less is the last. Ground: no verdict turns on a tenth of a nat.
        steep: nats that an amplitude of the discrepancy alone promises by its slope, from where on a climb has ended on
            no maximum and begins anew. Ground: those that do end on one promise less than a nat, the lost one 1e9.
        shortened: halvings of a step to where a fine simulation fails. Ground: cost; a thirtieth of the step is left.
        floor: log evidence below which a set is hopeless and not followed further.
        anchor: whether a cheap simulation's correction is taken anew where the fit comes to rest.
    """

    rounds: int = 4
    iterations: int = 12
    first: float = 0.5
    later: float = 0.1
    settled: float = 0.1
    steep: float = 10.0
    shortened: int = 5
    floor: float = -math.inf
    anchor: bool = True


@dataclass(frozen=True)
class Effort:
    """How much is tried.

    Attributes:
        most: effects in a set at most. Ground: sets of four have no prior (`Criteria.sizes`).
        singles, pairs, triples: sets weighed when sets of that size are grown. Ground: cost.
        parents: sets of one and of two that are grown further. Ground: cost.
        spare: nominees of a parent beyond its share of these sets. Ground: cost; some are tried by another already.
        reshaped: sets that are tried in all their forms, by size. Ground: cost.
        starts: settings of the shapes that a set is begun from. Ground: cost; the linear step ranks the others lower.
        worthwhile: gain of a setting's linear step from where on it is begun from too, share of the best one's. Ground:
            fits gain less than half as much more or less than their steps promise.
        short: settings of a shape that are all tried where nothing is named yet, if they are no more. Ground: a linear
            step ranks directions of strong fibres badly.
        spend: cost of a search's predictions (of the plain base model each) after which nothing new is begun.
            Ground: cost, a quarter of an hour at most; the costliest three of 64 sealed cases spend a quarter of it.
        nested: searches and memories nested in a prediction at most. Ground: cost, which each multiplies.
        trial: iterations of a fit that only compares starts. Ground: cost.
        least: nats that the linear step of a single effect has to promise. Ground: less than its share of the prior
            can bring back; negative, for a step is short where a gap or a frequency leads far.
        hopeful: nats below the best set up to which other forms and further effects of a set are tried, below the best
            start up to which another one is followed, and below a set inside it up to which a descent is believed.
            Ground: what another form gains, seldom more; one in three thousand.
        given_up: nats below the best set at which a set is not followed to the end of its fit, and up to which what it
            holds with one effect less is tried. Ground: a later round brings back less; of what is held, cost: two to
            four sets a search.
        promised: times the gain of a linear step that a set may gain, where predictions are costly. Ground: fits gained
            0.1 to 0.9 of it where it was 30 nats and more (p02).
        readings: times that noise is read again from what the best set leaves. Ground: cost, each is a search more.
        again: sets weighed anew where something may have happened at once. Ground: cost.
        stepwise: a second effect is sought only where a first one has come in.
        shown: steps of a fit that is shown. Ground: fits end by themselves before.
        rivals: alternatives that get a fit of their own. Ground: a page shows no more.
        course: how far the fit of a set of effects is followed; that of the base as a `Course` is by default, for all
            sets are held against it.
    """

    most: int = 3
    singles: int = 10
    pairs: int = 10
    triples: int = 6
    parents: tuple[int, int] = (3, 2)
    spare: int = 2
    reshaped: tuple[int, ...] = (2, 1, 0)
    starts: int = 2
    worthwhile: float = 0.5
    short: int = 4
    spend: float = 1e6
    nested: int = 2
    trial: int = 5
    least: float = -4.0
    hopeful: float = 8.0
    given_up: float = 20.0
    promised: float = 2.0
    readings: int = 2
    again: int = 6
    stepwise: bool = False
    shown: int = 100
    rivals: int = 3
    course: Course = field(default_factory=Course)
