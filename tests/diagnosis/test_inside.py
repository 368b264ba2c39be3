"""A set holds every set inside it: where its descent ends far below one of them it is followed from there too."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.test_nearly import relaxing
from tissuejax.diagnosis.diagnose import asked_of
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course, Effort
from tissuejax.diagnosis.judgement.explore import Exploration
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.search import based, rooted
from tissuejax.diagnosis.judgement.weigh import Start, weigh
from tissuejax.recordings.recording import Channel, Recording, Sample

BEST = -50.0


def weighed(key: tuple[str, ...], worth: float, idle: tuple[str, ...] = (), **values: float) -> SimpleNamespace:
    evidence = SimpleNamespace(keys=key, names=key, void=bool(idle), log_evidence=worth)
    fit = SimpleNamespace(values=values)
    return SimpleNamespace(evidence=evidence, v=np.array([worth]), bench=None, refit=fit, idle=idle)


class Descents(Kept):
    """What weighing a set comes to: `astray` from where a search begins it, `back` from the fit of a set inside it."""

    def __init__(self, astray: float, back: float):
        super().__init__()
        self.astray, self.back, self.starts = astray, back, []

    def weigh(self, scales, keys, start, criteria, course):
        self.starts.append(start)
        return weighed(tuple(keys), self.astray if start.v is None else self.back)


def explored(descents: Descents, hum: float = BEST, costly: bool = False) -> Exploration:
    does = {"hum": ("height",), "gap": ("width",), "other": ()}
    candidates = {k: SimpleNamespace(name=k, widens={}, amplitudes=a) for k, a in does.items()}
    bench = SimpleNamespace(candidates=candidates, costly=costly, spent=0.0, start={"height": 0.0, "width": 0.0})
    sets = {frozenset(): weighed((), -90.0), frozenset({"gap"}): weighed(("gap",), -60.0)}
    sets |= {
        frozenset({"hum"}): weighed(("hum",), hum, mu=3.0, height=2.0),
        frozenset({"other"}): weighed(("other",), BEST),
    }
    found = Exploration(bench, Criteria(), Effort(), None, weighed=sets, kept=descents)
    found.__dict__["before"] = SimpleNamespace(log_prior=lambda evidence: 0.0)
    return found


def test_a_set_far_below_one_inside_it_is_followed_from_there():
    descents = Descents(astray=-500.0, back=-45.0)
    e = explored(descents)
    e.weigh(("hum", "gap"), [{"mu": 1.0, "width": 0.1, "edge": 5.0}])
    assert e.weighed[frozenset({"hum", "gap"})].evidence.log_evidence == -45.0
    first, second, again = descents.starts
    assert first.v is None
    assert again is second  # what it is there, and where it leads
    # as that one, what is added at nothing and of the shape that it began with
    assert second.values == {"mu": 3.0, "height": 2.0, "width": 0.0, "edge": 5.0}
    assert second.v == np.array([BEST])


def test_shapes_are_those_of_the_first_start_and_far_below_is_less_than_hopeful():
    descents = Descents(astray=BEST - 9.0, back=-45.0)
    e = explored(descents)
    e.weigh(("hum", "gap"), [{"edge": 5.0}, {"edge": 6.0}])
    assert descents.starts[-1].values == {"mu": 3.0, "height": 2.0, "width": 0.0, "edge": 5.0}


def test_what_ends_lower_there_is_not_taken():
    e = explored(Descents(astray=-500.0, back=-600.0))
    e.weigh(("hum", "gap"), [{}])
    assert e.weighed[frozenset({"hum", "gap"})].evidence.log_evidence == -500.0


@pytest.mark.parametrize(
    ("astray", "hum", "costly"),
    [(BEST - 7.0, BEST, False), (-500.0, BEST - 21.0, False), (-500.0, BEST, True)],
    ids=["as good as that one", "that one is far from the best", "simulations"],
)
def test_elsewhere_one_descent_is_enough(astray, hum, costly):
    descents = Descents(astray, back=-45.0)
    e = explored(descents, hum, costly)
    e.weighed[frozenset({"gap"})].evidence.log_evidence = -300.0
    e.weigh(("hum", "gap"), [{}])
    assert len(descents.starts) == 1


def test_what_a_set_is_without_its_idle_effect_is_weighed_once():
    idle = Idle(BEST + 5.0)
    e = explored(idle)
    e.weighed[frozenset({"other", "hum"})] = weighed(("other", "hum"), -60.0)
    e.weigh(("other", "hum", "gap"), [{}])
    assert len(idle.asked) == 1


class Idle(Kept):
    """A gap does nothing wherever it is."""

    def __init__(self, worth: float):
        super().__init__()
        self.worth, self.asked = worth, []

    def weigh(self, scales, keys, start, criteria, course):
        self.asked.append((tuple(keys), start))
        return weighed(tuple(keys), self.worth, tuple(k for k in keys if k == "gap"), height=7.0)


@pytest.mark.parametrize(("worth", "asked"), [(BEST + 5.0, 2), (BEST - 5.0, 1)])
def test_a_set_with_an_effect_at_nothing_that_would_be_the_best_is_weighed_without_it(worth, asked):
    idle = Idle(worth)
    e = explored(idle)
    e.weigh(("other", "hum", "gap"), [{}])
    assert len(idle.asked) == asked
    if asked == 2:
        keys, start = idle.asked[1]
        assert keys == ("other", "hum")
        assert start.values == {"height": 7.0}  # from that fit
        assert start.v == np.array([worth])
        assert e.best == frozenset({"other", "hum"})


def test_a_set_that_is_resumed_stays_where_it_was():
    """Of specimens that relax by a power of time, what a series errs by is a part of what is left. Resumed without it,
    a fit leaves the place where that part has been found: it lost 7 to 65 nats, by specimen and noise."""
    rng, recordings = np.random.default_rng(2), {}
    for k, (share, top, speed) in enumerate([(0.8, 0.15, 0.3), (0.9, 0.25, 0.03)]):
        time, stretch, stress = relaxing(share, top, speed, rng)
        channels = {"nominal_stress": Channel(time, stress, "Pa", 3.0)}
        recordings[f"s{k}"] = Recording(f"s{k}", "uniaxial", {"time": time, "stretch": stretch}, channels)
    asked = asked_of(Sample("relaxing", recordings), "reduced-polynomial-2", effects=["viscoelasticity"])
    cut, of = asked.left()
    scales, base = based(asked.whole, cut, of, Criteria(), Kept())
    rooted(scales, base, asked.whole.free)
    key = "viscoelasticity/one time"
    start = {**base.refit.values, **scales.bench.candidates[key].grid[0]}
    found = weigh(scales, (key,), Start(start), Criteria(), Course())
    assert found.evidence.amplitudes["effects"] > 0.01
    resumed = Start(start, found.v, found.bench, at=found.refit.values)
    again = weigh(scales, (key,), resumed, Criteria(), replace(Course(), rounds=1))
    assert again.evidence.log_evidence > found.evidence.log_evidence - 1.0


class Places(Kept):
    """Starts by the place that a trial leads to, with its evidence, and where that ends when it is followed."""

    TRIED = {"a": -50.0, "b": -50.05, "c": -55.0, "d": -59.0}
    ENDS = {"a": -48.0, "b": -48.0, "c": -20.0, "d": -10.0}

    def __init__(self):
        super().__init__()
        self.followed = []

    def weigh(self, scales, keys, start, criteria, course):
        (place,) = start.values
        if course.rounds > 1:
            self.followed.append(place)
        return weighed(tuple(keys), (self.ENDS if course.rounds > 1 else self.TRIED)[place], **{place: 1.0})


@pytest.mark.parametrize(("costly", "followed", "best"), [(False, ["a", "c"], -20.0), (True, ["a"], -48.0)])
def test_starts_that_come_near_the_best_one_are_followed_each_place_once(costly, followed, best):
    """A trial's order is not that of where it leads; b is where a is, and d is farther off than is made good."""
    places = Places()
    e = explored(places, costly=costly)
    found = e.weigh(("slack",), [{p: 1.0} for p in "dbac"])
    assert (places.followed, found.evidence.log_evidence) == (followed, best)


class Broken(Kept):
    """A fine simulation that breaks down at a stiffness of 3, and nowhere else."""

    def __init__(self):
        super().__init__()
        self.asked = []

    def weigh(self, scales, keys, start, criteria, course):
        self.asked.append(dict(start.values))
        found = weighed(tuple(keys), -math.inf if start.values["mu"] == 3.0 else BEST - 1.0)
        found.settled = True
        return found


def test_where_the_fine_simulation_breaks_down_a_set_is_settled_from_the_base():
    e = explored(Broken())
    e.scales = SimpleNamespace(bench=e.bench, values={"mu": 1.0})
    e.bench.base = ("mu",)
    for w in e.weighed.values():
        w.settled = True
    hum = frozenset({"hum"})
    e.weighed[hum].settled = False
    e.settle(1)
    assert e.kept.asked == [{"mu": 3.0, "height": 2.0}, {"mu": 1.0, "height": 2.0}]
    assert e.weighed[hum].evidence.log_evidence == BEST - 1.0


@pytest.mark.parametrize(
    ("pair", "costly", "tried"), [(-60.0, False, True), (-80.0, False, False), (-60.0, True, False)]
)
def test_what_a_set_near_the_top_holds_is_tried_though_no_linear_step_led_there(pair, costly, tried):
    """Gap and hum came in beside another effect; without it they were never weighed, and are the best set."""
    descents = Descents(astray=-20.0, back=-20.0)
    e = explored(descents, costly=costly)
    e.weighed[frozenset({"hum", "gap", "other"})] = weighed(("hum", "gap", "other"), pair, mu=2.0)
    e.weighed[frozenset({"hum", "other"})] = weighed(("hum", "other"), -70.0)
    e.weighed[frozenset({"gap", "other"})] = weighed(("gap", "other"), -70.0)
    for key in e.near(3, below=e.effort.given_up):
        e.look_inside(key)
    assert (frozenset({"hum", "gap"}) in e.weighed) is tried
    assert [dict(s.values) for s in descents.starts] == ([{"mu": 2.0}] if tried else [])
