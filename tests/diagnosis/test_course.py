"""The course of a search, by hand: which sets are weighed, in which order and from where, with known evidence."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tissuejax.diagnosis.judgement import explore, search
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.explore import Exploration
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.scales import Scales
from tissuejax.diagnosis.score import Score
from tissuejax.estimation.correlation import GAIN

FORMS = {"hum": ["hum"], "gap": ["gap", "gap/late", "gap/twice"], "drift": ["drift"], "wide": ["law"]}
NAMES = {form: name for name, forms in FORMS.items() for form in forms}


def candidate(form: str) -> SimpleNamespace:
    return SimpleNamespace(
        key=form,
        name=NAMES[form],
        widens={"law": 0.1} if form == "law" else {},
        amplitudes=() if form == "law" else (f"{form}.size",),
        shapes=(),
        nominated=form in ("hum", "gap", "drift", "law"),
        grid=[{f"{form}.edge": float(k)} for k in range(5)],
        beside={"gap": ("gap/late",), "gap/late": ("gap", "gap/twice"), "gap/twice": ("gap/late",)}.get(form, ()),
    )


def weighed(keys: tuple[str, ...], worth: float, void: bool = False, **values: float) -> SimpleNamespace:
    evidence = SimpleNamespace(keys=keys, names=keys, void=void, log_evidence=worth, amplitudes={})
    fit = SimpleNamespace(values=values, prediction=np.zeros(1))
    return SimpleNamespace(
        evidence=evidence, v=np.array([1e-6]), bench=f"bench of {keys}", refit=fit, idle=(), settled=True, begun={}
    )


class Known(Kept):
    """Weighing comes to what a table says, a thousand nats below the base where it says nothing."""

    def __init__(self, table: dict[tuple[str, ...], float]):
        super().__init__()
        self.table, self.asked, self.courses = {frozenset(k): x for k, x in table.items()}, [], []

    def weigh(self, scales, keys, start, criteria, course):
        self.courses.append(course)
        self.asked.append((tuple(keys), dict(start.values), start.v, start.bench))
        return weighed(tuple(keys), self.table.get(frozenset(keys), -1000.0), **start.values)

    @property
    def order(self) -> list[frozenset]:
        return list(dict.fromkeys(frozenset(keys) for keys, *_ in self.asked))


def score(form: str, gain: float, settings: int = 1) -> Score:
    trials = tuple((gain - k, {f"{form}.size": 2.0}, {f"{form}.edge": float(k)}) for k in range(settings))
    return Score(form, gain, 0.5, {}, {}, np.zeros(0), trials)


def explored(table, scored=None, costly=False, nested=lambda keys: 0, **effort) -> Exploration:
    """A search that has weighed the base alone, at -100 nats."""
    free = {f"{f}.size": SimpleNamespace(lower=-math.inf, upper=math.inf, scale=1.0) for f in NAMES}
    bench = SimpleNamespace(
        candidates={f: candidate(f) for f in NAMES},
        costly=costly,
        spent=0.0,
        start={f"{f}.size": 0.0 for f in NAMES},
        free=free,
        base=("mu",),
        nested=nested,
    )
    scales = Scales(bench, None, ("slow",), None, None, {}, np.zeros(1), 1.0)
    base = weighed((), -100.0, mu=1.0)
    e = Exploration(bench, Criteria(), Effort(**effort), scales, weighed={frozenset(): base}, kept=Known(table))
    e.__dict__["before"] = SimpleNamespace(log_prior=lambda evidence: 0.0)
    e.scored |= {frozenset(k): rows for k, rows in (scored or {}).items()}
    return e


def sets(*keys: str) -> list[frozenset]:
    return [frozenset(k.split("+")) for k in keys]


def test_what_cannot_be_is_worth_nothing():
    e = explored({})
    e.weighed |= {
        frozenset({"hum"}): weighed(("hum",), -10.0, void=True),
        frozenset({"gap"}): weighed(("gap",), np.nan),
    }
    assert [e.worth(k) for k in sets("hum", "gap")] == [-math.inf, -math.inf]
    assert e.best == frozenset()
    assert e.ranked(1) == []


def test_worth_is_evidence_and_prior_together():
    e = explored({})
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0)
    e.__dict__["before"] = SimpleNamespace(log_prior=lambda evidence: -3.0)
    assert e.worth(frozenset({"hum"})) == -53.0


def test_forms_of_an_effect_are_one_company_but_for_what_widens_the_discrepancy():
    e = explored({})
    assert e.company(frozenset({"law", "gap/late"})) == {"law", "gap"}
    assert e.names(frozenset({"law", "gap/late"})) == {"wide", "gap"}
    assert e.same(frozenset({"gap", "hum"}), frozenset({"hum", "gap/late"}))
    assert not e.same(frozenset({"gap"}), frozenset({"hum"}))


def test_near_is_less_than_hopeful_below_the_best():
    e = explored({})
    for form, worth in (("hum", -50.0), ("gap", -57.9), ("drift", -58.1)):
        e.weighed[frozenset({form})] = weighed((form,), worth)
    e.weighed[frozenset({"hum", "drift"})] = weighed(("hum", "drift"), -51.0)
    assert e.near(1) == sets("hum", "gap")
    assert e.near(1, below=8.2) == sets("hum", "gap", "drift")


def test_nominees_of_several_sets_take_turns_and_no_set_is_weighed_twice():
    rows = {
        ("hum",): [score("gap", 9.0), score("drift", 8.0)],
        ("gap",): [score("hum", 9.0), score("drift", 7.0)],
    }
    e = explored({}, rows)
    e.weighed |= {frozenset({k}): weighed((k,), -50.0, mu=2.0) for k in ("hum", "gap")}
    e.extend(sets("hum", "gap"), most=10, each=3)
    # a law that widens the discrepancy needs no step and comes first; of the others the pair of both only once
    assert e.kept.order == sets("hum+law", "gap+law", "hum+gap", "hum+drift", "gap+drift")


@pytest.mark.parametrize(("most", "each", "pairs"), [(2, 3, 2), (10, 1, 2), (10, 2, 3), (0, 3, 0)])
def test_so_many_sets_are_weighed_and_so_many_of_each_parent(most, each, pairs):
    """With one of each the two that widen; with two the pair of both, which is the next of either."""
    rows = {("hum",): [score("gap", 9.0), score("drift", 8.0)], ("gap",): [score("hum", 9.0), score("drift", 7.0)]}
    e = explored({}, rows)
    e.weighed |= {frozenset({k}): weighed((k,), -50.0) for k in ("hum", "gap")}
    e.extend(sets("hum", "gap"), most, each)
    assert len(e.kept.order) == pairs


def test_the_best_form_that_a_step_promises_is_the_one_that_is_tried():
    e = explored({}, {(): [score("gap/late", 9.0), score("gap", 8.0)]})
    e.extend([frozenset()], 10, 10)
    assert e.kept.order == sets("law", "gap/late")


def test_what_was_weighed_before_takes_no_turn_from_the_next():
    """Three sets nominate each other: what the second has in common with the first is left out, the third goes on."""
    rows = {("hum",): [score("gap", 9.0)], ("gap",): [score("hum", 9.0)], ("drift",): [score("hum", 9.0)]}
    e = explored({("law",): -500.0}, rows)
    e.weighed |= {frozenset({k}): weighed((k,), -50.0) for k in ("hum", "gap", "drift", "law")}
    e.weighed |= {frozenset({k, "law"}): weighed((k, "law"), -500.0) for k in ("hum", "gap", "drift")}
    e.extend(sets("hum", "gap", "drift"), 10, 10)
    assert e.kept.order == sets("gap+hum", "drift+hum")


@pytest.mark.parametrize(
    ("parent", "costly", "gain", "tried"),
    [
        ((), False, -3.9, True),
        ((), False, -4.1, False),
        ((), True, -0.5, True),
        (("gap",), False, -0.5, True),
        (("gap",), True, -0.5, False),
        (("gap",), True, 0.5, True),
    ],
)
def test_a_step_has_to_promise_something(parent, costly, gain, tried):
    """Little beside nothing or where a prediction costs nothing; beside a set of simulations some gain."""
    e = explored({}, {parent: [score("hum", gain)]}, costly)
    e.weighed[frozenset(parent)] = weighed(parent, -100.0)
    e.extend([frozenset(parent)], 5, 5)
    assert (frozenset({*parent, "hum"}) in e.weighed) is tried


@pytest.mark.parametrize(("parent", "tried"), [(-57.5, True), (-58.5, False)])
def test_a_step_that_promises_a_loss_takes_nothing_from_its_set(parent, tried):
    e = explored({}, {(): [score("hum", -2.0)]}, costly=True)
    e.weighed |= {frozenset(): weighed((), parent), frozenset({"gap"}): weighed(("gap",), -50.0)}
    e.extend([frozenset()], 5, 5)
    assert (frozenset({"hum"}) in e.weighed) is tried


def test_who_may_join_a_set(monkeypatch):
    """Another effect that is nominated, has an amplitude, and nests no search within two others."""
    asked = []
    monkeypatch.setattr(explore, "nominated", lambda *given: asked.append([c.key for c in given[3]]) or [])
    e = explored({}, nested=lambda keys: 3 if "drift" in keys else 2)
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0)
    assert e.score(frozenset({"hum"})) == e.score(frozenset({"hum"})) == []
    assert asked == [["gap"]]  # once


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
    effort = e.effort
    assert (trial.rounds, trial.iterations, trial.floor) == (1, effort.trial, -math.inf)
    assert (last.rounds, last.iterations, last.floor) == (effort.rounds, effort.iterations, -45.0 - effort.given_up)
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


def test_a_set_is_begun_from_its_parents_fit_and_the_linear_step():
    """Settings whose steps gain half as much are begun from too, two of them beside a set; of the base, all of four."""
    steps = {(): [score("hum", 9.0, settings=4)], ("hum",): [score("gap", 9.0, settings=4)]}
    e = explored({("hum", "gap"): -49.0}, steps)
    e.extend([frozenset()], 5, 5)
    begun = [values for keys, values, *_ in e.kept.asked if keys == ("hum",)]
    assert begun[:4] == [{"mu": 1.0, "hum.size": 2.0, "hum.edge": float(k)} for k in range(4)]
    hum = e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0, mu=3.0)
    e.kept.asked.clear()
    e.extend([frozenset({"hum"})], 5, 5)
    begun = [row for row in e.kept.asked if row[0] == ("hum", "gap")]
    tried = [{"mu": 3.0, "gap.size": 2.0, "gap.edge": k} for k in (0.0, 1.0)]
    assert [values for _, values, *_ in begun[:2]] == tried
    assert all(values in tried for _, values, *_ in begun)
    assert {bench for *_, bench in begun} == {hum.bench}


def test_one_start_is_one_setting():
    e = explored({("hum",): -99.0}, {(): [score("hum", 9.0, settings=4)]}, starts=1)
    e.extend([frozenset()], 5, 5)
    assert [values["hum.edge"] for keys, values, *_ in e.kept.asked if keys == ("hum",)] == [0.0]


def test_beside_others_an_effect_begins_where_it_was_alone_too_and_in_its_best_form():
    e = explored({("hum", "gap/late"): -49.0}, {("hum",): [score("gap", 9.0)]})
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0, mu=3.0)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -60.0, mu=5.0, **{"gap.size": 7.0})
    e.weighed[frozenset({"gap/late"})] = weighed(("gap/late",), -55.0, mu=6.0, **{"gap/late.size": 8.0})
    e.extend(sets("hum"), 5, 5)
    of = {keys: [v for k, v, *_ in e.kept.asked if k == keys] for keys in (("hum", "gap"), ("hum", "gap/late"))}
    assert {"mu": 3.0, "gap.size": 7.0} in of["hum", "gap"]
    assert of["hum", "gap/late"] == [{"mu": 3.0, "gap/late.size": 8.0}]


@pytest.mark.parametrize("costly", [False, True])
def test_where_predictions_cost_nothing_the_best_form_alone_is_another_start(costly):
    """Nominated is a form whose name comes after that of the one that was best alone."""
    e = explored({("hum", "gap"): -49.0}, {("hum",): [score("gap/late", 90.0)]}, costly)
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0, mu=3.0)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -55.0, mu=5.0, **{"gap.size": 7.0})
    e.extend(sets("hum"), 5, 5)
    assert [v for keys, v, *_ in e.kept.asked if keys == ("hum", "gap")] == (
        [] if costly else [{"mu": 3.0, "gap.size": 7.0}]
    )


def test_forms_are_changed_as_long_as_that_gains():
    """From late to twice though twice is no neighbour of the form that was nominated; from worse ones nowhere."""
    e = explored({("gap/late",): -45.0, ("gap/twice",): -40.0})
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0, mu=3.0)
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -30.0)
    e.reshape(frozenset({"gap"}))
    assert e.kept.order == sets("gap/late", "gap/twice")
    e = explored({("gap/late",): -55.0})
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0, mu=3.0)
    e.reshape(frozenset({"gap"}))
    assert e.kept.order == sets("gap/late")
    # alone from the first three settings, each beside the fit of the form before
    begun = [values for _, values, *_ in e.kept.asked]
    assert begun[:3] == [{"mu": 3.0, "gap/late.edge": k} for k in (0.0, 1.0, 2.0)]
    assert all(values in begun[:3] for values in begun)


@pytest.mark.parametrize(("late", "tried"), [(-57.0, True), (-59.0, False)])
def test_beside_others_a_form_that_was_far_behind_alone_is_not_tried(late, tried):
    e = explored({})
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -30.0)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0)
    e.weighed[frozenset({"gap/late"})] = weighed(("gap/late",), late)
    e.weighed[frozenset({"hum", "gap"})] = weighed(("hum", "gap"), -40.0)
    e.reshape(frozenset({"hum", "gap"}))
    assert (frozenset({"hum", "gap/late"}) in e.weighed) is tried
    if tried:  # two settings beside another effect
        assert len({v["gap/late.edge"] for keys, v, *_ in e.kept.asked if "gap/late" in keys}) == 2


@pytest.mark.parametrize(("depth", "tried"), [(2, True), (3, False)])
def test_searches_within_searches_within_searches_are_not_begun(depth, tried):
    e = explored({}, nested=lambda keys: depth if "gap/late" in keys else 0)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0)
    e.reshape(frozenset({"gap"}))
    assert (frozenset({"gap/late"}) in e.weighed) is tried


def test_every_effect_of_a_set_is_left_out_once_from_where_the_set_rests():
    e = explored({})
    pair = e.weighed[frozenset({"hum", "gap"})] = weighed(("hum", "gap"), -40.0, mu=3.0)
    e.leave_out(frozenset({"hum", "gap"}))
    assert e.kept.asked == [(("gap",), {"mu": 3.0}, pair.v, pair.bench), (("hum",), {"mu": 3.0}, pair.v, pair.bench)]
    e.kept.asked.clear()
    e.leave_out(frozenset({"hum"}))
    assert e.kept.asked == []  # the base has been weighed


@pytest.mark.parametrize(("promised", "tried"), [(21.1, True), (20.9, False)])
def test_a_costly_set_that_would_stay_behind_is_not_begun(promised, tried):
    """The best at -50, a parent at -100: what is hopeful begins at -58, and a step may gain twice what it promises."""
    e = explored({}, {(): [score("hum", promised)]}, costly=True)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0)
    e.extend([frozenset()], 5, 5)
    assert (frozenset({"hum"}) in e.weighed) is tried


def test_a_costly_set_that_stays_behind_takes_no_turn_from_the_next():
    e = explored({}, {("gap",): [score("hum", 1.0)], ("drift",): [score("hum", 90.0)]}, costly=True)
    e.weighed |= {frozenset({"gap"}): weighed(("gap",), -100.0), frozenset({"drift"}): weighed(("drift",), -50.0)}
    e.weighed |= {frozenset({k, "law"}): weighed((k, "law"), -500.0) for k in ("gap", "drift")}
    e.extend(sets("gap", "drift"), 5, 5)
    assert e.kept.order == sets("drift+hum")


def test_predictions_that_cost_nothing_do_not_count_where_others_do():
    """A law that only widens the discrepancy beside two effects, of which one may be weighed."""
    rows = {(): [score("hum", 90.0), score("drift", 90.0)]}
    e = explored({}, rows, costly=True)
    e.extend([frozenset()], most=1, each=1)
    assert set(e.kept.order) == set(sets("law", "hum"))


@pytest.mark.parametrize(
    ("gained", "kept", "costly", "white", "read"),
    [
        (GAIN / 2 + 0.1, "hum", False, False, True),
        (GAIN / 2 - 0.1, "hum", False, False, False),
        (GAIN / 2 + 0.1, "", False, False, False),
        (GAIN / 2 + 0.1, "hum", True, False, False),
        (GAIN / 2 + 0.1, "hum", False, True, False),
    ],
    ids=["likelier", "not by enough", "nothing found", "simulations", "white before and after"],
)
def test_noise_is_read_again_where_the_best_set_is_likelier_for_it(monkeypatch, gained, kept, costly, white, read):
    noise = SimpleNamespace(noise=None if white else "of the residual")
    monkeypatch.setattr(search, "shown", lambda *_: noise)
    e = explored({("hum",): -50.0 + gained}, costly=costly)
    e.scales.blocked = SimpleNamespace(noise=None)
    if kept:
        e.weighed[frozenset({kept})] = weighed((kept,), -50.0, mu=3.0)
    found = search.noise_beside(e)
    assert (found is noise) if read else found is None


class Course:
    """A search that writes down what it is asked for, with a best set of so many effects."""

    def __init__(self, best: int, strange: bool, parents: dict[int, list[str]], costly: bool = False):
        self.best, self.strange, self.told = frozenset(f"e{i}" for i in range(best)), strange, []
        self.parent_sets, self.bench = parents, SimpleNamespace(costly=costly)
        for name in ("extend", "reshape", "settle", "leave_out", "look_inside"):
            setattr(self, name, lambda *given, name=name: self.told.append((name, *given)))

    def parents(self, size):
        return self.parent_sets.get(size, [])

    def near(self, size, below=None):
        return [f"{size} near {below}", "another", "a third"]

    def log_worth(self, base):
        return base.worth

    def worth(self, key):
        return -50.0


def course(monkeypatch, found: Course, happened: float = -60.0, **effort) -> tuple[list, list]:
    """What a search is asked for, and beside which bases its singles are weighed."""
    bases, moment = [], SimpleNamespace(worth=happened)
    monkeypatch.setattr(search, "alone", lambda bench, scales, base, by: (bases.append(base), found)[1])
    monkeypatch.setattr(search, "disrupted", lambda scales, base, *more: (scales, moment))
    search.searched(found.bench, None, "base", search.Setup(effort=Effort(**effort)))
    return found.told, ["what happened" if b is moment else b for b in bases]


def test_pairs_and_triples_are_grown_shaped_and_looked_into(monkeypatch):
    parents = {1: list("abcd"), 2: list("efg")}
    told, _ = course(monkeypatch, Course(2, False, parents))
    of_pairs = [("extend", list("abc"), 10, 5), ("reshape", "2 near None"), ("settle", 2)]
    of_pairs += [("leave_out", frozenset({"e0", "e1"}))]
    of_pairs += [("look_inside", k) for k in ("2 near 20.0", "another", "a third")] + [("settle", 1)]
    of_triples = [("extend", list("ef"), 6, 5), ("settle", 3), ("leave_out", frozenset({"e0", "e1"}))]
    of_triples += [("look_inside", k) for k in ("3 near 20.0", "another", "a third")] + [("settle", 2)]
    assert told == of_pairs + of_triples


@pytest.mark.parametrize(
    ("best", "strange", "parents", "effort", "sizes"),
    [
        (1, False, (1, 2), {}, [10]),
        (1, True, (1, 2), {}, [10, 6]),
        (2, False, (1, 2), {"most": 2}, [10]),
        (2, False, (1, 2), {"most": 1}, []),
        (2, False, (1,), {}, [10]),
        (2, False, (), {}, []),
        (0, True, (1, 2), {"stepwise": True}, []),
        (1, True, (1, 2), {"stepwise": True}, [10]),
        (2, False, (1, 2), {"stepwise": True}, [10, 6]),
    ],
    ids=["no second", "strange", "two", "one", "no pair", "nothing", "no step", "one step", "both steps"],
)
def test_a_third_effect_is_sought_where_a_second_came_in_or_much_is_left(
    monkeypatch, best, strange, parents, effort, sizes
):
    told, _ = course(monkeypatch, Course(best, strange, {k: ["a"] for k in parents}), **effort)
    assert [most for name, *given in told if name == "extend" for most in given[1:2]] == sizes


@pytest.mark.parametrize(("happened", "beside"), [(-49.0, ["base", "what happened"]), (-51.0, ["base"])])
def test_what_happened_at_once_comes_in_first_where_it_is_likelier_than_any_effect(monkeypatch, happened, beside):
    assert course(monkeypatch, Course(1, False, {}), happened)[1] == beside


@pytest.mark.parametrize(("costly", "left_out"), [(True, 1), (False, 0)])
def test_simulations_begin_the_base_again_from_the_best_effect(monkeypatch, costly, left_out):
    told, _ = course(monkeypatch, Course(1, False, {}, costly))
    assert [name for name, *_ in told] == ["leave_out"] * left_out
