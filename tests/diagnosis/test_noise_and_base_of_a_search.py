"""How a search is begun, what its single effects are beside, and how often its noise is read, by hand."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from known_sets import explored, weighed
from straight_bench import GAIN, MEANS, Given, scales_of, straight

from tissuejax.diagnosis.judgement import search as module
from tissuejax.diagnosis.judgement.blocks import blocks
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course, Effort
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.search import Setup
from tissuejax.diagnosis.judgement.weigh import Start
from tissuejax.errors import NotConverged
from tissuejax.estimation.correlation import GAIN as WORTH

search: Any = module  # its stand-ins are no benches, scales and sets
START = {"a": 5.0, "b": 0.0}


class Told(Kept):
    """Sets weighed by name: the base comes to 10 x + 20 x^3, with the evidence that is given."""

    def __init__(self, *worth: float):
        super().__init__()
        self.worth, self.asked = iter(worth), []

    def weigh(self, scales, keys, start, criteria, course):
        self.asked.append((keys, start, course, scales.blocked))
        return weighed(tuple(keys), next(self.worth), a=10.0, b=20.0)


@pytest.mark.parametrize("start", [None, Start({"a": 7.0, "b": 1.0}, at={"a": 8.0, "b": 2.0})])
@pytest.mark.parametrize("noise", [None, "coloured"])
def test_the_base_is_weighed_again_where_its_residual_shows_coloured_noise(monkeypatch, start, noise):
    bench, seen, course = straight({}), [], Course(rounds=7)
    monkeypatch.setattr(search, "coloured", lambda *given: seen.append(given) or noise)
    kept = Told(-50.0, -40.0)
    cut = blocks(bench, {"force": MEANS})
    scales, base = search.based(bench, cut, Given(GAIN), Criteria(), kept, start, course)
    (keys, first, how, white), *more = kept.asked
    assert (keys, first, how) == ((), start or Start(START), course)
    assert scales.values == first.values
    np.testing.assert_array_equal(scales.reference, cut.mean(bench.y))
    ((blocked, of, means, prediction),) = seen
    assert (blocked, of, means, prediction.tolist()) == (white, bench, cut, [0.0])
    if noise is None:
        assert not more
        assert (base.evidence.log_evidence, scales.blocked) == (-50.0, white)
    else:
        ((keys, again, how, blocked),) = more
        assert (keys, again, how, blocked) == ((), Start({"a": 10.0, "b": 20.0}), course, noise)
        assert (base.evidence.log_evidence, scales.blocked) == (-40.0, noise)


@pytest.mark.parametrize("worth", [-np.inf, np.nan])
def test_a_base_that_cannot_be_predicted_is_an_error_that_names_the_recordings(worth):
    bench = straight({})
    with pytest.raises(NotConverged, match="can't be fitted to p, q: its prediction is not finite"):
        search.based(bench, blocks(bench), Given(GAIN), Criteria(), Told(worth))


def test_sizes_are_taken_at_the_base_s_fit_and_without_priors():
    bench: Any = straight({})
    scales = scales_of(bench)
    base = weighed((), -50.0, a=11.0, b=19.0)
    base.refit.prediction, base.bench = np.asarray(bench.predict({"a": 11.0, "b": 19.0})), bench
    taken = []
    bench.__class__ = type("Near", (type(bench),), {n: near(n, taken) for n in ("anchored", "rooted")})
    free = {"a": 1, "b": 2}
    search.rooted(scales, base, free)
    assert scales.values == {"a": 11.0, "b": 19.0}
    np.testing.assert_allclose(scales.reference, scales.cut.mean(base.refit.prediction))
    assert taken == [("anchored", scales.values), ("rooted", scales.values)]
    assert scales.bench is bench
    assert scales.bench.free == free
    assert scales.bench.free is not free
    base.bench, own = None, scales.bench
    search.rooted(scales, base, free)
    assert scales.bench is own


def near(name: str, taken: list):
    return lambda self, values: taken.append((name, dict(values))) or self


class Single:
    """An exploration that writes down what it is asked for: of three single effects one is likelier than none."""

    def __init__(self, strange: bool, *given, kept=None, until=0.0):
        self.given, self.kept, self.until, self.strange, self.told = given, kept, until, strange, []
        for name in ("extend", "reshape", "settle"):
            setattr(self, name, lambda *asked, name=name: self.told.append((name, *asked)))

    def near(self, size):
        return [f"near {size}", "next", "third"] if size == 1 else []

    def ranked(self, size):
        return ["better", "equal", "worse"] if size == 1 else []

    def worth(self, key):
        return {"better": -49.0, "equal": -50.0, "worse": -51.0, frozenset(): -50.0}[key]


@pytest.mark.parametrize(
    ("strange", "costly", "reshaped"),
    [
        (False, False, ["near 1", "next", "better"]),
        (True, False, ["near 1", "next", "better", "equal", "worse"]),
        (False, True, ["near 1", "next"]),
        (True, True, ["near 1", "next"]),
    ],
)
def test_single_effects_likelier_than_none_are_tried_in_all_their_forms(monkeypatch, strange, costly, reshaped):
    """All of them where much is left; none but the best two where predictions are simulations."""
    monkeypatch.setattr(search, "Exploration", lambda *given, **more: Single(strange, *given, **more))
    bench, scales = straight({}), scales_of(straight({}))
    scales.bench.counted.cost = 30.0
    bench.__class__ = type("Costly", (type(bench),), {"costly": costly})
    base = weighed((), -50.0, a=10.0, b=20.0)
    base.refit.prediction, base.bench = scales.bench.predict({"a": 10.0, "b": 20.0}), None
    by = Setup(effort=Effort(spend=12.0, singles=7, reshaped=(2, 9, 9)), kept=Told())
    e = search.alone(bench, scales, base, by)
    assert e.told == [("extend", [frozenset()], 7, 7), *(("reshape", k) for k in reshaped), ("settle", 1)]
    assert (e.until, e.kept) == (42.0, by.kept)
    given = (scales.bench, by.criteria, by.effort, scales, by.report, {frozenset(): base})
    assert e.given == given
    assert scales.values == {"a": 10.0, "b": 20.0}


def test_a_search_is_done_with_the_usual_numbers_and_tells_nobody():
    by = Setup()
    assert (by.criteria, by.effort, by.report("now"), by.kept.path) == (Criteria(), Effort(), None, None)


@pytest.mark.parametrize(("readings", "noises", "searches"), [(2, 0, 1), (2, 1, 2), (2, 5, 3), (0, 5, 1), (1, 5, 2)])
def test_a_search_is_made_anew_as_often_as_noise_is_read_again(monkeypatch, readings, noises, searches):
    told, read, looked = [], iter([f"noise {i}" for i in range(noises)]), []
    scales = scales_of(straight({}))
    monkeypatch.setattr(search, "based", lambda *given: told.append(given) or (scales, "base"))
    best = weighed(("own",), -10.0, a=1.0)

    def searched(bench, on, base, by):
        found = SimpleNamespace(weighed={"best": best}, best="best", noise_of=None, blocked=on.blocked, base=base)
        found.look_again = lambda: looked.append(found)
        return found

    monkeypatch.setattr(search, "searched", searched)
    monkeypatch.setattr(search, "noise_beside", lambda e: next(read, None))
    reports, kept = [], Told(*[-50.0 - i for i in range(5)])
    first = weighed((), -1.0, a=3.0, b=4.0)
    monkeypatch.setattr(search, "based", lambda *given: told.append(given) or (scales, first))
    by = Setup(effort=Effort(readings=readings, course=Course(rounds=9)), report=reports.append, kept=kept)
    e = search.explore("bench", "cut", "of", by)
    assert told == [("bench", "cut", "of", by.criteria, kept)]
    assert reports == ["fitting the base model"]
    assert looked == [e]
    starts = [{"a": 3.0, "b": 4.0}, *[{"a": 10.0, "b": 20.0}] * 3]
    again = [((), Start(starts[i]), Course(), f"noise {i}") for i in range(searches - 1)]
    assert kept.asked == again
    assert e.noise_of is (best if searches > 1 else None)
    assert e.blocked == (f"noise {searches - 2}" if searches > 1 else scales.blocked)
    assert e.base is first if searches == 1 else e.base.evidence.log_evidence == -50.0 - (searches - 2)


@pytest.mark.parametrize(("old", "new", "read"), [(None, None, False), ("was", None, True), (None, "is", True)])
def test_noise_may_come_out_white_where_it_was_not(monkeypatch, old, new, read):
    """The best set is weighed from where it rests, its priors by where it began."""
    e: Any = explored({("hum",): -50.0 + WORTH})
    e.scales.blocked = SimpleNamespace(noise=old)
    e.bench.base = ("mu",)
    best = weighed(("hum",), -50.0, mu=3.0)
    best.begun = {"mu": 1.0}
    e.weighed[frozenset({"hum"})] = best
    seen, told = [], []
    noise, followed = SimpleNamespace(noise=new), []
    monkeypatch.setattr(search, "shown", lambda *given: seen.append(given) or noise)
    e.report = told.append
    real = e.kept.follow

    def follow(scales, keys, start, criteria, course):
        followed.append((scales.blocked, keys, start, criteria, course))
        return real(scales, keys, start, criteria, course)

    e.kept.follow = follow
    assert (search.noise_beside(e) is noise) == read
    assert seen == [(e.scales.blocked, e.bench, e.scales.cut, best.refit.prediction)]
    if read:
        expected = (noise, ("hum",), Start({"mu": 1.0}, best.v, at={"mu": 3.0}), e.criteria, e.effort.course)
        assert followed == [expected]
    assert "hum" in "".join(told)


@pytest.mark.parametrize(("above", "read"), [(0.0, False), (1e-9, True)])
def test_noise_has_to_gain_more_than_half_of_what_a_correlation_costs(monkeypatch, above, read):
    """In nats; as much is not enough."""
    e: Any = explored({("hum",): WORTH / 2 + above})
    e.scales.blocked = SimpleNamespace(noise=None)
    e.weighed[frozenset({"hum"})] = weighed(("hum",), 0.0, mu=3.0)
    monkeypatch.setattr(search, "shown", lambda *_: SimpleNamespace(noise="of the residual"))
    assert (search.noise_beside(e) is not None) == read


class Grown(Single):
    """A search of which only the growing of sets is of interest, with two effects in its best set."""

    best, bench = frozenset({"e0", "e1"}), SimpleNamespace(costly=False)

    def __init__(self, parents: dict[int, list[str]], worth: float):
        super().__init__(False)
        self.sets, self.happened = parents, worth
        self.leave_out = self.look_inside = lambda *_: None

    def parents(self, size):
        return self.sets.get(size, [])

    def near(self, size, below=None):
        return []

    def log_worth(self, base):
        return self.happened

    def worth(self, key):
        return -50.0


def grown(monkeypatch, parents: dict[int, list[str]], worth: float = -60.0, **effort) -> tuple[list, int]:
    """What sets are extended with, and how often single effects are weighed."""
    made, begun = Grown(parents, worth), []
    monkeypatch.setattr(search, "alone", lambda *given: begun.append(given) or made)
    monkeypatch.setattr(search, "disrupted", lambda scales, base, *_: (scales, "disturbed"))
    search.searched(made.bench, None, "base", Setup(effort=Effort(**effort)))
    return [given for name, *given in made.told if name == "extend"], len(begun)


@pytest.mark.parametrize(("pairs", "each"), [(1, 3), (2, 3), (3, 3), (5, 3), (6, 4), (7, 4)])
def test_each_parent_has_its_share_of_the_pairs_and_one_at_least(monkeypatch, pairs, each):
    """Of three parents, and two nominees to spare."""
    told, _ = grown(monkeypatch, {1: list("abc")}, pairs=pairs)
    assert told == [[list("abc"), pairs, each]]


def test_without_pairs_no_triples_are_grown(monkeypatch):
    assert grown(monkeypatch, {2: ["a"]})[0] == []


@pytest.mark.parametrize(("worth", "begun"), [(-50.0, 1), (-49.9, 2), (-50.1, 1)])
def test_what_happened_has_to_beat_every_single_effect(monkeypatch, worth, begun):
    assert grown(monkeypatch, {}, worth)[1] == begun
