"""What a page says that a set leaves: sizes, shares and parts of the rest, and the share of the misfit that went."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from straight_bench import GAIN, MEANS, scales_of, straight

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.judgement import answer as answers
from tissuejax.diagnosis.judgement.answer import Answered, open_sets
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.judge import Kind
from tissuejax.diagnosis.judgement.rest import level, numerical, scatter, told_apart, unlike_noise, wobble
from tissuejax.estimation.discrepancy import Part, Series, discrepancy
from tissuejax.estimation.sudden import Moment

USUAL = Criteria()
AT = {"a": 10.0, "b": 20.0}
WHITE = Part("white", "white", within=tuple(np.diag(np.linspace(1.0, 3.0, MEANS)) for _ in range(2)))
MESH = Part("mesh", "numerical", factor=np.linspace(0, 2, 4 * MEANS).reshape(-1, 2))
SPEED = Part("speed", "numerical", within=tuple(0.1 * np.eye(MEANS) for _ in range(2)))


def answered(bench, rest, amplitudes, keys=(), held_out=()):
    """An answer whose set leaves `rest` in block means."""
    scales = scales_of(bench, GAIN, WHITE)
    weighed = SimpleNamespace(rest=rest, parts=(GAIN, WHITE), v=np.array([1e-4, 4e-4]))
    chosen = SimpleNamespace(keys=keys, amplitudes=amplitudes, kurtosis=1.7)
    bench.held_out, bench.fitted = held_out, tuple(n for n in ("p", "q") if n not in held_out)
    exploration = SimpleNamespace(scales=scales, weighed={frozenset(keys): weighed}, criteria=USUAL)
    return Answered(bench, exploration, None, SimpleNamespace(chosen=chosen, negligible=0.25))


def test_the_rest_is_told_by_recording_and_by_part():
    bench = straight({})
    bench.candidates["scatter"] = Candidate("scatter", (), widens={"gain": 0.15})
    rest = np.concatenate([np.full(MEANS, 0.3), np.linspace(-0.2, 0.5, MEANS)])
    found = answered(bench, rest, {"gain": 0.01, "white": 0.02}, ("scatter",))
    told, scales = found.rest(), found.exploration.scales
    squares = rest**2 * scales.cut.counts
    own = [squares[:MEANS].sum(), squares[MEANS:].sum()]
    assert told["rms"] == pytest.approx(math.sqrt(sum(own) / 60))
    assert told["share_of_peak"] == pytest.approx(told["rms"] / scales.peak)
    assert told["recordings"] == pytest.approx({"p": own[0] / sum(own), "q": own[1] / sum(own)})
    assert told["parts"] == {"white": 0.02}
    assert told["named"] == {"gain": 0.01}
    assert (told["unit"], told["negligible"], told["kurtosis"], told["at_once"]) == ("N", 0.25, 1.7, [])
    np.testing.assert_allclose(found.rest_size(), np.full(60, told["rms"]))


def test_of_nothing_no_recording_has_a_share():
    told = answered(straight({}), np.zeros(2 * MEANS), {"gain": 0.0, "white": 0.0}).rest()
    assert told["rms"] == 0.0
    assert told["recordings"] == {"p": 0.0, "q": 0.0}


def test_what_happened_at_once_is_told_with_the_largest_first():
    found = answered(straight({}), np.zeros(2 * MEANS), {"gain": 0, "white": 0, "one": 0.02, "two": 0.3, "none": 0.0})
    line = np.linspace(0, 1, 4)
    series = [Series(n, n, line, line[:, None], np.zeros((4, 3)), 1.0) for n in ("p", "q")]
    of = discrepancy(series, np.ones(8), at_once=True)
    rows = np.zeros(8, bool)
    moments = (Moment("one", 0, 0.7, rows, rows, 0.1), Moment("none", 0, 0.2, rows, rows, 0.1))
    of = of.__class__(**{**of.__dict__, "sudden": (*moments, Moment("two", 1, 0.4, rows, rows, 0.1))})
    found.exploration.scales.discrepancy = of
    assert found.rest()["at_once"] == [
        {"recording": "q", "time": 0.4, "amplitude": 0.3},
        {"recording": "p", "time": 0.7, "amplitude": 0.02},
    ]


def test_the_share_explained_is_of_what_lies_beyond_noise_over_what_anyone_asks():
    """One recording whose noise is what counts, one where half a per cent of the range is more."""
    bench = straight({})
    bench.sigma = np.where(np.arange(60) < 30, 2.0, 1e-3)
    found = answered(bench, np.zeros(2 * MEANS), {"gain": 0, "white": 0}, ("own",), held_out=("q",))
    base, chosen = (SimpleNamespace(prediction=bench.y - e * np.where(np.arange(60) < 30, 1, 0.2)) for e in (8.0, 3.0))
    found.refits = {frozenset(): base, frozenset({"own"}): chosen}
    inside, outside = found.explained
    assert inside == pytest.approx(1 - (9 - 4) / (64 - 4))
    unseen = (USUAL.negligible * np.ptp(bench.y[30:])) ** 2
    assert unseen > 1e-6
    assert outside == pytest.approx(1 - (0.36 - 1e-6) / (2.56 - 1e-6))
    found.refits[frozenset({"own"})] = SimpleNamespace(prediction=bench.y - 12.0)
    assert found.explained[0] == 0.0  # worse is none
    found.refits[frozenset({"own"})] = SimpleNamespace(prediction=bench.y - 0.5)
    assert found.explained[0] == 1.0  # less than noise is all
    found.refits[frozenset()] = SimpleNamespace(prediction=bench.y - 1.0)
    assert found.explained[0] == 0.0  # of nothing there is no share


def test_what_scatters_beyond_the_stated_noise():
    bench = straight({})
    scales = scales_of(bench, GAIN, WHITE)
    parts, v = (GAIN, WHITE), np.array([0.5, 4e-4])
    variance = scales.blocked.sigma**2
    expected = 4e-4 * np.tile(np.linspace(1.0, 3.0, MEANS), 2) / variance
    np.testing.assert_allclose(scatter(scales, parts, v), expected)
    assert level(scales, parts, v) == pytest.approx(math.sqrt(1 + np.median(expected)))
    # in the mean 2 of it; what that is, noise or a rest, see test_unlike_noise
    factor, stated = math.sqrt(1 + 4e-4 * 2.0 / np.mean(variance)), math.sqrt(np.mean(variance)) / scales.peak
    assert unlike_noise(scales, parts, v, USUAL) == pytest.approx(told_apart(factor, stated, USUAL))
    bench.estimated = True
    assert level(scales, parts, v) == 1.0
    assert unlike_noise(scales, parts, v, USUAL) == (0.0, 0.0)
    bench.estimated = False
    bench.__class__ = type("Costly", (type(bench),), {"costly": True})
    assert unlike_noise(scales, parts, v, USUAL) == (0.0, 0.0)


def test_what_is_laid_to_a_mesh_is_a_share_of_the_peak():
    scales = scales_of(straight({}))
    v = np.array([0.5, 4.0, 9.0])
    mesh = np.mean(np.sum(MESH.factor**2, axis=1))
    found = numerical(scales, (GAIN, MESH, SPEED), v)
    assert found == pytest.approx(math.sqrt(4.0 * mesh + 9.0 * 0.1) / scales.peak)
    assert numerical(scales, (GAIN,), v[:1]) == 0.0


def test_how_surely_the_size_of_a_rest_is_known(rng):
    """Against draws of a vector whose neighbours are one in pairs."""
    mean, variance = rng.normal(size=20), rng.uniform(0.1, 1.0, 20)
    twice = np.repeat(mean, 2) + np.repeat(np.sqrt(variance) * rng.standard_normal((200_000, 20)), 2, axis=1)
    drawn = np.std(np.mean(twice**2, axis=1))
    assert wobble(np.repeat(mean, 2), np.repeat(variance, 2), 2) == pytest.approx(drawn, rel=0.01)


@pytest.mark.parametrize(
    ("costly", "kind", "expected"),
    [(False, Kind.FOUND, 2), (True, Kind.FOUND, 0), (True, Kind.AMBIGUOUS, 2), (False, Kind.NOTHING, 2)],
)
def test_as_many_sets_are_left_open_as_get_a_fit_of_their_own(monkeypatch, costly, kind, expected):
    """Where every prediction is a simulation only if the answer is that they can't be told apart."""
    monkeypatch.setattr(answers, "undecided", lambda judgement, criteria: (("a",), ("b",), ("a", "b")))
    bench, effort = SimpleNamespace(costly=costly), SimpleNamespace(rivals=2)
    found = SimpleNamespace(bench=bench, effort=effort, criteria=USUAL)
    assert open_sets(SimpleNamespace(kind=kind), found) == (("a",), ("b",))[:expected]


def test_squares_of_what_is_not_finite_are_infinite():
    assert answers.squares(np.array([3.0, 4.0])) == 25.0
    assert answers.squares(np.array([3.0, np.nan])) == math.inf
    assert answers.squares(np.array([])) == 0.0


def test_the_nearest_of_several_ends_is_shown_and_what_broke_down_is_not(monkeypatch):
    ends, asked = iter([math.nan, 7.0, 5.0, math.inf]), []

    def refit(bench, model, keys, start, iterations, final):
        asked.append((bench, model, keys, start, iterations, final))
        return SimpleNamespace(chi2=next(ends), start=start)

    monkeypatch.setattr(answers, "refit", refit)
    found = answers.nearest("bench", "model", ("own",), ({"a": 1}, {"a": 2}, {"a": 3}, {"a": 4}), 9)
    assert found.start == {"a": 3}
    assert asked == [("bench", "model", ("own",), {"a": k}, 9, False) for k in (1, 2, 3, 4)]
