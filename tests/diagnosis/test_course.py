"""The course of a search, by hand: which sets are weighed, in which order and from where, with known evidence."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tissuejax.diagnosis.judgement import search
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
        self.table, self.asked = {frozenset(k): x for k, x in table.items()}, []

    def weigh(self, scales, keys, start, criteria, course):
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


def test_near_is_less_than_hopeful_below_the_best():
    e = explored({})
    for form, worth in (("hum", -50.0), ("gap", -57.9), ("drift", -58.1)):
        e.weighed[frozenset({form})] = weighed((form,), worth)
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


@pytest.mark.parametrize(("gain", "tried"), [(-3.9, True), (-4.1, False)])
def test_a_step_has_to_promise_something(gain, tried):
    e = explored({}, {(): [score("hum", gain)]})
    e.extend([frozenset()], 5, 5)
    assert (frozenset({"hum"}) in e.weighed) is tried


def test_a_set_is_begun_from_its_parents_fit_and_the_linear_step():
    """Settings whose steps gain half as much are begun from too, two of them beside a set; of the base, all of four."""
    e = explored({}, {(): [score("hum", 9.0, settings=4)], ("hum",): [score("gap", 9.0, settings=5)]})
    e.extend([frozenset()], 5, 5)
    begun = [values for keys, values, *_ in e.kept.asked if keys == ("hum",)]
    assert begun[:4] == [{"mu": 1.0, "hum.size": 2.0, "hum.edge": float(k)} for k in range(4)]
    hum = e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0, mu=3.0)
    e.kept.asked.clear()
    e.extend([frozenset({"hum"})], 5, 5)
    begun = [row for row in e.kept.asked if row[0] == ("hum", "gap")]
    assert [values for _, values, *_ in begun[:2]] == [{"mu": 3.0, "gap.size": 2.0, "gap.edge": k} for k in (0.0, 1.0)]
    assert {bench for *_, bench in begun} == {hum.bench}


def test_beside_others_an_effect_begins_where_it_was_alone_too_and_in_its_best_form():
    e = explored({("hum", "gap/late"): -49.0}, {("hum",): [score("gap", 9.0)]})
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0, mu=3.0)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -60.0, mu=5.0, **{"gap.size": 7.0})
    e.weighed[frozenset({"gap/late"})] = weighed(("gap/late",), -55.0, mu=6.0, **{"gap/late.size": 8.0})
    e.extend(sets("hum"), 5, 5)
    of = {keys: [v for k, v, *_ in e.kept.asked if k == keys] for keys in (("hum", "gap"), ("hum", "gap/late"))}
    assert {"mu": 3.0, "gap.size": 7.0} in of["hum", "gap"]
    assert of["hum", "gap/late"] == [{"mu": 3.0, "gap/late.size": 8.0}]


def test_forms_are_changed_as_long_as_that_gains():
    """From late to twice though twice is no neighbour of the form that was nominated; from worse ones nowhere."""
    e = explored({("gap/late",): -45.0, ("gap/twice",): -40.0})
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0, mu=3.0)
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
