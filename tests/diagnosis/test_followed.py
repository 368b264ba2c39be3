"""How a set is weighed: from which start it is followed, how far, and again beside what happened at once."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.known_sets import Known, explored, sets, weighed
from tissuejax.diagnosis.judgement import explore
from tissuejax.diagnosis.judgement.explore import Exploration


def test_what_is_done_is_told():
    e, told = explored({}), []
    e.report = told.append
    e.weigh((), [{}], v=np.zeros(1))
    e.weigh(("hum", "drift"), [{}])
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0)
    e.weigh(("hum",), [{}])
    assert told == [
        "weighing base model; best so far: base model",
        "weighing hum + drift; best so far: base model",
        "weighing hum; best so far: gap",
    ]


@pytest.mark.parametrize(("spent", "begun"), [(10.0, True), (10.1, False)])
def test_nothing_new_is_begun_when_all_is_spent_but_the_base(spent, begun):
    e = explored({})
    assert not e.exhausted
    e.bench.spent, e.until = spent, 10.0
    found = e.weigh(("hum",), [{}])
    assert ((found is not None), e.exhausted) == (begun, not begun)
    assert e.weigh((), [{}], v=np.zeros(1)) is not None
    assert e.weigh(("hum",), [{}]) is found  # what was weighed is still there


def test_a_set_that_is_weighed_again_keeps_the_better():
    e = explored({("hum",): -50.0})
    old = e.weighed[frozenset({"hum"})] = weighed(("hum",), -40.0)
    assert e.weigh(("hum",), [{}], v=np.ones(1)) is old
    e.kept.table[frozenset({"hum"})] = -30.0
    assert e.weigh(("hum",), [{}]) is old  # not asked again without amplitudes to begin with
    assert e.weigh(("hum",), [{}], v=np.ones(1)).evidence.log_evidence == -30.0


@pytest.mark.parametrize("costly", [False, True])
def test_starts_are_compared_by_a_trial_and_followed_down_to_a_floor(costly):
    e = explored({("hum",): -50.0}, costly=costly)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -45.0)
    e.weigh(("hum",), [{"a": 1.0}, {"b": 1.0}])
    trial, *_, last = e.kept.courses
    effort, usual = e.effort, e.effort.course
    assert (trial.rounds, trial.iterations, trial.floor) == (1, effort.trial, -math.inf)
    assert (last.rounds, last.iterations, last.floor) == (usual.rounds, usual.iterations, -45.0 - effort.given_up)
    assert last.anchor is not costly


class Paths(Known):
    """Where a trial comes to and where that leads, by start; it ends at another place, or has none."""

    def __init__(self, tried: dict[str, float], ends: dict[str, float]):
        super().__init__({})
        self.tried, self.ends = tried, ends

    def weigh(self, scales, keys, start, criteria, course):
        self.asked.append((course.rounds, dict(start.values), start.v, start.bench))
        (place,) = start.values
        worth = (self.tried if course.rounds == 1 else self.ends)[place[0]]
        ends = {} if place == "nowhere" else {f"{place[0]} ended": 1.0}
        return replace_v(weighed(tuple(keys), worth, **ends), ord(place[0]))


def replace_v(w: SimpleNamespace, x: float) -> SimpleNamespace:
    w.v = np.array([float(x)])
    return w


def followed(tried, ends, costly=False, v=None) -> tuple[list, float]:
    e = explored({}, costly=costly)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0)
    e.kept = Paths(tried, ends)
    found = e.weigh(("hum",), [{p if p != "n" else "nowhere": 0.0} for p in tried], v=v)
    return [row[1:3] for row in e.kept.asked if row[0] > 1], found.evidence.log_evidence


def test_a_trial_is_followed_from_where_it_came_to():
    (one, two), best = followed({"a": -50.0, "n": -51.0}, {"a": -49.0, "n": -40.0})
    assert one == ({"a ended": 1.0}, np.array([97.0]))
    assert two == ({"nowhere": 0.0}, None)  # it came to nothing: from its start
    assert best == -40.0
    assert followed({"a": -50.0, "b": -51.0}, {"a": -49.0, "b": -40.0}, v=np.array([5.0]))[0][0][1] == np.array([5.0])


@pytest.mark.parametrize(("costly", "best"), [(False, -50.0), (True, -60.0)])
def test_a_trial_counts_where_following_it_led_away_and_every_prediction_is_exact(costly, best):
    """Of simulations a trial's predictions are corrected somewhere else: they are not compared."""
    assert followed({"a": -50.0, "b": -70.0}, {"a": -60.0, "b": -60.0}, costly)[1] == best


@pytest.mark.parametrize(("first", "ways"), [(-71.0, 1), (-69.0, 2)])
def test_what_ends_hopeless_is_the_last_that_is_followed(first, ways):
    """The best of all at -50: hopeless is what ends 20 nats below it."""
    assert len(followed({"a": -80.0, "b": -82.0}, {"a": first, "b": -40.0})[0]) == ways


def test_starts_are_held_against_the_best_of_them():
    assert len(followed({"a": -50.0, "b": -57.0, "c": -59.0}, dict.fromkeys("abc", -49.0))[0]) == 2


def test_what_is_inside_is_tried_for_every_effect_of_a_set():
    e = explored({})
    triple = frozenset({"gap", "hum", "drift"})
    e.weighed[triple] = weighed(("gap", "hum", "drift"), -40.0)
    e.look_inside(triple)
    assert e.kept.order == sets("hum+drift", "gap+drift", "gap+hum")


class Happenings:
    """Something happened so many times; `stays`: how often beside the best set."""

    def __init__(self, monkeypatch, times: int, stays: int):
        self.left, self.stays = times, stays
        monkeypatch.setattr(explore, "happened", self.happened)
        monkeypatch.setattr(explore, "joined", lambda scales, moment: (*scales, moment))
        monkeypatch.setattr(explore, "beside", self.beside)
        monkeypatch.setattr(explore, "held", self.held)

    def happened(self, scales, best, criteria):
        self.left -= 1
        return None if self.left < 0 else self

    moment = "a slip"

    def start(self, scales, w, criteria):
        return (scales, w.evidence.keys)

    def beside(self, w, moment):
        made = SimpleNamespace(**vars(w))
        made.evidence = SimpleNamespace(**vars(w.evidence) | {"moments": getattr(w.evidence, "moments", 0) + 1})
        return made

    def held(self, w, moment):
        self.stays -= 1
        return self.stays >= 0


def looked(monkeypatch, table, times=1, stays=9, again=1) -> Exploration:
    found = explored(table, again=again)
    for form, worth in (("hum", -50.0), ("gap", -60.0), ("drift", -70.0)):
        found.weighed[frozenset({form})] = weighed((form,), worth, mu=worth)
    found.scales = ()
    Happenings(monkeypatch, times, stays)
    found.look_again()
    return found


def test_beside_what_happened_the_best_sets_and_the_base_are_weighed_anew(monkeypatch):
    e = looked(monkeypatch, {("hum",): -45.0, (): -120.0, ("gap",): -1.0}, again=1)
    assert [(keys, values, v) for keys, values, v, _ in e.kept.asked] == [
        ((), {"mu": 1.0}, ((), ())),
        (("hum",), {"mu": -50.0}, ((), ("hum",))),
    ]
    assert e.scales == ("a slip",)
    worths = {next(iter(k), ""): w.evidence.log_evidence for k, w in e.weighed.items()}
    assert worths == {"": -100.0, "hum": -45.0, "gap": -60.0, "drift": -70.0}  # only what gains is taken
    assert {w.evidence.moments for k, w in e.weighed.items() if k != frozenset({"hum"})} == {1}


@pytest.mark.parametrize("again", [1, 2, 3])
def test_so_many_sets_are_weighed_anew(monkeypatch, again):
    e = looked(monkeypatch, {}, again=again)
    assert [keys for keys, *_ in e.kept.asked] == [(), ("hum",), ("gap",), ("drift",)][: again + 1]


@pytest.mark.parametrize(("stays", "rounds"), [(0, 1), (1, 2), (9, 3)])
def test_it_is_looked_again_as_long_as_what_happened_stays(monkeypatch, stays, rounds):
    e = looked(monkeypatch, {}, times=3, stays=stays)
    assert e.scales == ("a slip",) * rounds
