"""Where fits begin: moduli by enumeration of faces, draws by their distribution, times and loads at rest by hand."""

import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.stats

from tissuejax.estimation.weights import Weights
from tissuejax.fitting.memory import begun_loaded, spread, time_bounds, times
from tissuejax.fitting.starts import fitted_moduli, neutral, variations
from tissuejax.recordings.recording import Channel, Recording

INF = np.inf


class Moduli:
    """Residuals X m - data in the moduli m of an energy, then rows of priors that don't count."""

    stiffness, loss = 0.0, "cauchy"

    def __init__(self, X, data, bounds, priors=(), bent=None, typical=1.0):
        self.X, self.data, self.bounds, self.bent = X, data, bounds, bent or (lambda m: m)
        self.moduli = tuple(f"m{i}" for i in range(X.shape[1]))
        self.free = ("before", *self.moduli)
        self.priors = dict.fromkeys(priors, (0.0, 1.0))
        self.n_samples, self.runs = len(data), 0
        known = {p: SimpleNamespace(typical=typical) for p in self.free}
        self.predictor = SimpleNamespace(model=SimpleNamespace(parameters=known))

    def bound(self, path):
        return self.bounds.get(path, (-INF, INF))

    def residuals(self, values):
        self.runs += 1
        m = np.array([values[p] for p in self.moduli])
        return np.concatenate([self.X @ self.bent(m) - self.data, [1e6 * m[0]]])

    def linearised(self, values):
        J = np.full((len(self.data) + 1, len(self.free)), 1e6)
        J[:-1, 1:] = self.X
        J[:-1, 0] = 7.0
        return self.residuals(values), J


def moduli(*given, **options) -> Any:
    return Moduli(*given, **options)


def on_faces(X, target, low, high) -> np.ndarray:
    """The least squares between bounds, by trying which of them hold."""
    found = []
    for held in itertools.product((0, 1, 2), repeat=X.shape[1]):
        x = np.array([(lo, hi, 0.0)[h] for lo, hi, h in zip(low, high, held, strict=True)])
        loose = [i for i, h in enumerate(held) if h == 2]
        if not np.isfinite(x).all():
            continue
        x[loose] = np.linalg.lstsq(X[:, loose], target - X @ x, rcond=None)[0]
        if np.all((x >= low) & (x <= high)):
            found.append((float(np.sum((X @ x - target) ** 2)), tuple(x)))
    return np.array(min(found)[1])


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("signs", [(1, 1, 1), (1, -1, 0), (-1, 0, -1)])
def test_moduli_begin_at_the_least_squares_of_their_signs_and_bounds(seed, signs):
    """One that comes out as nothing has a thousandth of the data, on the side where it began."""
    rng = np.random.default_rng(seed)
    X, data = rng.normal(size=(15, 3)) * [1.0, 100.0, 0.01], 10 * rng.normal(size=15)
    bounds = {"m0": (-1.0, 3.0), "m1": (-0.02, 0.03), "m2": (-INF, INF)}
    posed = moduli(X, data, bounds)
    now = np.array([0.5, 0.005, 50.0]) * signs
    values = {"before": 4.0, "other": 9.0} | dict(zip(posed.moduli, now, strict=True))
    low = np.array([0.0 if s > 0 else bounds[p][0] for s, p in zip(signs, posed.moduli, strict=True)])
    high = np.array([0.0 if s < 0 else bounds[p][1] for s, p in zip(signs, posed.moduli, strict=True)])
    solved = on_faces(X, data, low, high)
    least = 1e-3 * np.linalg.norm(data) / np.linalg.norm(X, axis=0)
    expected = np.where((np.abs(solved) > least) | (np.array(signs) == 0), solved, least * signs)
    found = fitted_moduli(posed, values)
    assert found["before"] == 4.0
    assert found["other"] == 9.0
    np.testing.assert_allclose([found[p] for p in posed.moduli], expected, rtol=1e-6, atol=1e-12)


def test_a_start_on_the_side_of_a_bound_beyond_zero_keeps_that_bound():
    X, data = np.eye(2), np.array([0.1, -0.1])
    posed = moduli(X, data, {"m0": (0.5, 3.0), "m1": (-3.0, -0.5)})
    found = fitted_moduli(posed, {"m0": 2.0, "m1": -2.0})
    assert (found["m0"], found["m1"]) == pytest.approx((0.5, -0.5), rel=1e-6)


@pytest.mark.parametrize(("share", "kept"), [(1.1e-3, True), (0.9e-3, False)])
def test_a_modulus_of_less_than_a_thousandth_of_the_data_has_a_thousandth(share, kept):
    X, data = np.diag([2.0, 4.0]), np.array([1.0, share])
    found = fitted_moduli(moduli(X, data, {}), {"m0": 1, "m1": 1})
    assert found["m0"] == pytest.approx(0.5)
    assert found["m1"] == pytest.approx((share if kept else 1e-3 * np.hypot(1.0, share)) / 4, rel=1e-6)
    assert isinstance(found["m0"], float)
    assert fitted_moduli(moduli(X, data, {}), {"m0": 1, "m1": 0})["m1"] == pytest.approx(share / 4, rel=1e-6)
    held = moduli(X, np.array([1.0, 0.0]), {"m1": (0.0, 1e-4)})
    assert fitted_moduli(held, {"m0": 1.0, "m1": 5e-5})["m1"] == 1e-4  # no more than its bound


def test_a_start_stays_where_moduli_have_priors_nothing_is_seen_or_it_would_be_worse():
    X, data = np.eye(2), np.array([3.0, 4.0])
    start = {"m0": 1.0, "m1": 1.0}
    assert fitted_moduli(moduli(X, data, {}), start) == pytest.approx({"m0": 3.0, "m1": 4.0})
    assert fitted_moduli(moduli(X, data, {}, priors=("m0",)), start) == pytest.approx({"m0": 1.0, "m1": 4.0})
    both = moduli(X, data, {}, priors=("m0", "m1"))
    assert fitted_moduli(both, start) == start
    assert both.runs == 0
    for spoiled in (np.array([[1.0, 0.0], [0.0, 0.0]]), np.array([[1.0, 0.0], [0.0, np.nan]])):
        assert fitted_moduli(moduli(spoiled, data, {}), start) == start
    assert fitted_moduli(moduli(X, np.array([3.0, np.nan]), {}), start) == start
    assert fitted_moduli(moduli(X, data, {}, bent=lambda m: np.where(m == 1.0, m, -m)), start) == start
    best = {"m0": 3.0, "m1": 4.0}
    assert fitted_moduli(moduli(X, data, {}), best) == best


def effect(name, *amplitudes):
    return SimpleNamespace(name=name, amplitudes=amplitudes)


def posed(effects, start, free) -> Any:
    return SimpleNamespace(predictor=SimpleNamespace(model=SimpleNamespace(effects=effects)), start=start, free=free)


def test_effects_that_begin_at_nothing_are_left_out_all_together_and_each_but_one():
    effects = (effect("p", "a", "unknown"), effect("q", "a", "b"), effect("r", "a"), effect("s", "a"))
    start = {"energy.m": 1.0, "effects.p.a": 0.0, "effects.p.t": 3.0, "effects.q.a": 0.0, "effects.q.b": 0.0}
    start |= {"effects.r.a": 0.1, "effects.s.a": 0.0}
    p, q = ("effects.p.a", "effects.p.t"), ("effects.q.a", "effects.q.b")
    free = ("energy.m", *p, *q, "effects.r.a")
    assert neutral(posed(effects, start, free)) == [p + q, q, p]
    assert neutral(posed(effects, start | {"effects.q.b": 1e-9}, free)) == [p]
    assert neutral(posed(effects, start, p + q)) == []  # nothing would be left
    assert neutral(posed(effects, start, ("energy.m", "effects.r.a"))) == []
    assert neutral(posed((), start, ("energy.m",))) == []
    three = ("energy.m", *p, *q, "effects.s.a")
    s = ("effects.s.a",)
    assert neutral(posed(effects, start, three)) == [p + q + s, q + s, p + s, p + q]


def test_further_starts_are_drawn_as_is_stated():
    """Logarithms of a normal law of 0.7, what is at zero by 0.7 of what is typical, both signs; what falls outside a
    range evenly in its inner 96 %."""
    first = {"before": -2.0, "m0": 10.0, "m1": 1e-6 * 5.0, "m2": 1.001e-6 * 5.0, "fixed": 8.0}
    drawn_from = moduli(np.eye(3), np.ones(3), {"m0": (9.9999, 10.0001)}, priors=("m0", "m1", "m2"), typical=5.0)
    made = list(variations(drawn_from, first, 2000, 3))
    assert len(made) == 2000
    assert first["m0"] == 10.0
    x = {p: np.array([v[p] for v in made]) for p in first}
    for steps in (np.log(x["before"] / -2.0), x["m1"] / 5.0, np.log(x["m2"] / 5.005e-6)):
        assert scipy.stats.kstest(steps, scipy.stats.norm(0, 0.7).cdf).pvalue > 1e-3
    assert set(x["fixed"]) == {8.0}
    share = (x["m0"] - 9.9999) / 0.0002
    assert scipy.stats.kstest(share, scipy.stats.uniform(0.02, 0.96).cdf).pvalue > 1e-3
    assert np.all((share > 0.0199) & (share < 0.9801))
    again = list(variations(drawn_from, first, 3, 3))
    assert again == made[:3]
    assert list(variations(drawn_from, first, 3, 4)) != again
    assert list(variations(drawn_from, first, 0, 3)) == []


@pytest.mark.parametrize(("bounds", "begun"), [((-INF, 10.0), 10.0), ((0.0, INF), 0.0), ((-INF, 0.0), 0.0)])
def test_what_is_drawn_beyond_an_only_bound_is_on_it(bounds, begun):
    """Half of what is drawn from there."""
    posed = moduli(np.eye(1), np.ones(1), {"m0": bounds}, priors=("m0",))
    drawn = np.array([v["m0"] for v in variations(posed, {"before": 1.0, "m0": begun}, 400, 3)])
    assert np.mean(drawn == begun) == pytest.approx(0.5, abs=0.1)
    assert np.all((drawn >= bounds[0]) & (drawn <= bounds[1]))


def test_moduli_of_further_starts_are_solved_for_unless_the_search_does():
    X, data = np.eye(2), np.array([3.0, 4.0])
    first = {"before": 1.0, "m0": 1.0, "m1": 1.0}
    for v in variations(moduli(X, data, {}), first, 5, 0):
        assert [v["m0"], v["m1"]] == pytest.approx([3.0, 4.0])
    projected = moduli(X, data, {})
    projected.loss = "squares"
    assert all(v["m0"] != pytest.approx(3.0) for v in variations(projected, first, 5, 0))


def recorded(*channels) -> Any:
    return SimpleNamespace(channels={str(i): SimpleNamespace(time=t) for i, t in enumerate(channels)})


def predicts(recordings, effects, parameters=None, names=None) -> Any:
    model = SimpleNamespace(effects=effects, parameters=parameters or {})
    sample = SimpleNamespace(recordings=recordings)
    return SimpleNamespace(model=model, sample=sample, names=tuple(names or recordings))


def declared(lower=0.0, upper=INF) -> Any:
    return SimpleNamespace(lower=lower, upper=upper)


def test_times_lie_between_the_finest_tenth_of_the_sampling_and_three_lengths():
    """Steps of 0.02 in a tenth of the time, then of 1; another channel is longer and sampled more coarsely."""
    uneven = np.concatenate([[5.0], 5.0 + np.cumsum(np.repeat([0.02, 1.0], [20, 80]))])
    effects = (SimpleNamespace(name="plain", times=()), SimpleNamespace(name="e", times=("t1", "t2", "t3")))
    paths = [f"effects.e.t{i}" for i in (1, 2, 3)]
    known = dict(zip(paths, (declared(), declared(0.5, 20.0), declared(400.0, 900.0)), strict=True))
    even, single, still = np.arange(0.0, 121.0, 2.0), np.array([0.0]), np.array([3.0, 3.0])
    some = {"r": recorded(uneven, even), "s": recorded(single, still), "unused": recorded(np.arange(0, 9e3, 1e-3))}
    found = time_bounds(predicts(some, effects, known, ("s", "r")))
    assert times(predicts(some, effects)) == paths
    assert found == {paths[0]: (pytest.approx(0.02), 360.0), paths[1]: (0.5, 20.0)}
    below = {"r": recorded(np.concatenate([[0.0], np.cumsum(np.repeat([0.02, 1.0], [9, 91]))]))}
    assert time_bounds(predicts(below, effects, known))[paths[0]][0] == pytest.approx(1.0)  # nine in a hundred
    assert time_bounds(predicts({"s": recorded(single, still)}, effects, known)) == {}
    two = {"s": recorded(np.array([1.0, 4.0]))}
    assert time_bounds(predicts(two, effects[:2], known)) == {paths[0]: (3.0, 9.0), paths[1]: (3.0, 9.0)}
    same = dict.fromkeys(paths, declared(9.0, INF))
    assert time_bounds(predicts(two, effects, same)) == {}  # from 9 to 9 is no range
    assert times(predicts({}, effects[:1])) == []


def test_times_to_begin_with_stand_evenly_between_the_bounds_a_third_of_the_longest_at_most():
    bounds = {"effects.e.t1": (1.0, 24.0), "effects.f.t1": (2.0, 6.0), "effects.e.t2": (5.0, 24.0)}
    found = spread(bounds)
    assert found == pytest.approx({"effects.e.t1": 2.0, "effects.e.t2": 4.0, "effects.f.t1": 2.0})
    narrow = {"effects.e.t1": (4.0, 6.0)}  # a third of the end lies below the beginning
    assert spread(narrow) == {"effects.e.t1": 4.0}
    assert spread({}) == {}


def pulled(drive, stress, kind="stretch", channel="nominal_stress") -> Recording:
    time = np.arange(float(len(drive)))
    return Recording("r", "x", {"time": time, kind: np.asarray(drive)}, {channel: Channel(time, stress, "Pa")}, {})


def loads(recording, std=None) -> list[str]:
    return begun_loaded({"r": recording, "q": recording}, ["r"], Weights(std or {}))


@pytest.mark.parametrize("kind", ["stretch", "shear"])
@pytest.mark.parametrize(("at", "loaded"), [(0.0, False), (0.0039, False), (0.0041, True), (-0.0041, True)])
def test_a_recording_is_begun_under_load_from_a_fiftieth_of_the_largest_drive_on(kind, at, loaded):
    rest = 1.0 if kind == "stretch" else 0.0
    drive = rest + np.array([at, 0.05, 0.1, 0.15, 0.2, 0.2, 0.1, 0.0])
    said = loads(pulled(drive, np.zeros(8), kind))
    assert len(said) == loaded
    if loaded:
        assert said[0].startswith(f"r ({kind} {rest + at:.4g}) begins under load, so it was cut out")


@pytest.mark.parametrize("still", [1, 3, 5, 9])
@pytest.mark.parametrize(("level", "top"), [(5.0, 100.0), (0.1, 400.0), (0.0, 400.0), (0.0, 10.0)])
@pytest.mark.parametrize("by", [0.98, 1.02])
def test_a_stress_at_rest_counts_from_four_standard_errors_and_three_hundredths_of_the_largest(still, level, top, by):
    """The mean of what was measured before anything is done, of five samples at most, of the component where it is
    larger; a lost sample later on is left out."""
    n = min(still, 5)
    limit = max(4 * level / np.sqrt(n), 0.03 * top)
    drive = np.where(np.arange(20) < still, 1.0, 1.2)
    stress = np.full((20, 2), top / 2)
    stress[:still] = 0.0
    stress[:n, 1] = -by * limit * 2 * np.arange(1, n + 1) / (n + 1)
    stress[n:still, 1] = 0.9 * top
    stress[-1], stress[-2, 0] = np.nan, -top
    said = loads(pulled(drive, stress), {"r/nominal_stress": level} if level else {})
    assert len(said) == (by > 1)
    if said:
        assert said[0].startswith(f"r (a stress of {by * limit:.3g} Pa at rest) begins under load")


def test_of_recordings_that_are_no_material_tests_nothing_is_said():
    drive, zeros = np.array([1.1, 1.2, 1.2, 1.2, 1.2, 1.2]), np.zeros(6)
    assert loads(pulled(drive, zeros, "depth")) == []
    assert loads(pulled(drive, zeros, channel="force")) == []
    some = {"a": pulled(drive, zeros, "depth"), "b": pulled(drive, zeros), "c": pulled(drive - 0.9, zeros, "shear")}
    (said,) = begun_loaded(some, ["a", "b", "c"], Weights({}))
    assert said.startswith("b (stretch 1.1), c (shear 0.2) begins under load")
    wide = np.stack([np.full(6, 1.05), np.full(6, 0.9)], 1)
    (said,) = loads(pulled(wide, np.zeros((6, 2))))
    assert said.startswith("r (stretch 0.9)")
    for kind, first, told in (
        ("stretch", (1.2, 0.9), "1.2"),
        ("shear", (0.1, -0.3), "-0.3"),
        ("shear", (0.4, 0.3), "0.4"),
    ):
        drive = np.tile(first, (6, 1))
        assert loads(pulled(drive, np.zeros((6, 2)), kind))[0].startswith(f"r ({kind} {told}) begins")
    rest = pulled(np.ones(6), np.full(6, 7.0))  # nothing is ever done
    assert loads(rest) == ["r (a stress of 7 Pa at rest)" + said[len("r (stretch 0.9)") :]]
