"""Every sentence on a fit with its numbers, both sides of each limit and the limit itself; the fits are made up."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tissuejax.estimation.weights import Weights
from tissuejax.fitting import advice
from tissuejax.fitting.advice import warnings_of
from tissuejax.fitting.scores import Score
from tissuejax.recordings.recording import Channel, Recording

KEY = "r/force"


def score(chi2=1.0, rmse=1.0, n=100, rho=0.0) -> Score:
    return Score(rmse, "N", chi2, n, 0.99, rho)


def recording(*channels: str, shape: tuple[int, ...] = (100,), inputs: tuple[str, ...] = ()) -> Recording:
    """Magnitudes fall evenly from 1000 to 0, but for the first, which is a hundred times that."""
    values = np.linspace(-1000.0, 0.0, shape[0])
    values[:1] *= 100
    values = np.broadcast_to(values.reshape(-1, *[1] * (len(shape) - 1)), shape)
    time = np.arange(float(shape[0]))
    made = {c: Channel(time, values, "N") for c in channels or ("force",)}
    return Recording("r", "x", {kind: 1.0 + 0 * time for kind in inputs}, made, {})


def made(**what) -> Any:
    """A fit of which nothing is to be said, but for `what`."""
    spread = {"sentences": [], "condition": 10.0, "dof": math.inf, "inflation": None, "serial": False}
    spread = SimpleNamespace(**{k: what.pop(k, v) for k, v in spread.items()})
    effects = what.pop("effects", ())
    model = SimpleNamespace(
        effects=effects,
        parameters={
            "energy.k": SimpleNamespace(unit="1"),
            "energy.mu": SimpleNamespace(unit="Pa"),
        },
    )
    some = what.pop("recordings", [recording()])
    sample = SimpleNamespace(recordings={r.name: r for r in some})
    predictor = SimpleNamespace(model=model, sample=sample, names=tuple(sample.recordings))
    noise = Weights(what.pop("std", {KEY: 1.0}), what.pop("groups", {}))
    posed = SimpleNamespace(predictor=predictor, noise=noise, bound=lambda path: (0.25, 1234.5))
    usual = {"converged": True, "status": "converged", "at_bound": {}, "channels": {KEY: score()}, "holdout": {}}
    usual |= {"numerics": {}, "starts": [9.0], "free": (), "values": {}, "stability": SimpleNamespace(paths={})}
    return SimpleNamespace(problem=posed, uncertainty=spread, **usual | what)


def unstable(above=None, below=None) -> SimpleNamespace:
    return SimpleNamespace(paths={"u": SimpleNamespace(path="u", unstable_above=above, unstable_below=below)})


LOADED = recording("nominal_stress", inputs=("stretch",))
RELAXES = (SimpleNamespace(name="v", times=("tau1", "tau2", "tau3")),)


@pytest.mark.parametrize(("what", "words"), [
    ({"converged": False, "status": "no convergence"}, "Not converged: no convergence. The numbers below"),
    ({"at_bound": {"energy.k": "lower"}}, "energy.k ended at its lower bound (0.25); its standard error"),
    ({"at_bound": {"energy.mu": "upper"}}, "energy.mu ended at its upper bound (1234.5 Pa); its standard error"),
    ({"sentences": ["a is not seen."], "condition": 1e9}, "a is not seen."),
    ({"stability": unstable(above=1.3)}, "The fitted energy is unstable (Drucker) inside"),
    ({"effects": RELAXES, "recordings": [LOADED], "channels": {}}, "r (a stress of "),
    ({"condition": 1.001e6}, "The condition number is 1.0e+06: some parameters trade off"),
    ({"std": {KEY: 3.217, "q/m": 0.25}, "groups": {KEY: "N", "q/m": "m"}, "channels": {}},
     "estimated from the residuals: 3.22 (N), 0.25 (m). So chi-square says nothing"),
    ({"numerics": {"r": {"penetration": 0.07}}}, "In the simulation of r 7% of the probe's radius"),
])  # fmt: skip
def test_a_fit_is_said_what_is_wrong_with_it_and_nothing_else(what, words):
    assert warnings_of(made()) == []
    (said,) = warnings_of(made(**what))
    assert words in said


def test_nothing_is_said_on_the_quiet_side():
    assert warnings_of(made(condition=1e6)) == []
    assert warnings_of(made(recordings=[LOADED], channels={})) == []  # without times the past does not matter
    assert warnings_of(made(numerics={"r": {"penetration": 0.05}}, stability=unstable())) == []


def test_the_gravest_is_said_first():
    said = warnings_of(
        made(
            converged=False, status="s", at_bound={"energy.k": "lower"}, sentences=["unseen"],
            stability=unstable(below=0.9), channels={KEY: score(9.0, 90.0, rho=0.7)}, holdout={"h/f": score(99.0)},
            numerics={"r": {"inertia": 0.5}}, starts=[1.0, 2.0],
        )
    )  # fmt: skip
    begins = ["Not converged", "energy.k ended", "unseen", "The fitted energy", "The misfit", "Residuals of", "h/f"]
    begins += ["In the simulation", "Only 1 of 2"]
    assert [text[: len(begin)] for text, begin in zip(said, begins, strict=True)] == begins


@pytest.mark.parametrize(("ratio", "twins"), [(1.0, True), (1.051, True), (1 / 1.051, True), (1.052, False)])
def test_times_whose_logarithms_differ_by_less_than_a_twentieth_are_one(ratio, twins):
    path = "effects.v.tau{}".format
    values = {path(1): 4.0, path(2): 90.0, path(3): 4.0 * ratio}
    values |= {"effects.v.g1": 0.125, "effects.v.g2": 0.5, "effects.v.g3": 0.25}
    found = made(effects=RELAXES, free=tuple(reversed([path(i) for i in (1, 2, 3)])), values=values)
    said = warnings_of(found)
    assert len(said) == twins
    if twins:
        expected = f"{path(1)} and {path(3)} are the same time (4 s): only the sum of their shares is seen (0.375). "
        assert said == [expected + "One term fewer says as much, e.g. --effect viscoelasticity-2."]
    found.free = (path(1), path(2))  # the third is not free
    assert warnings_of(found) == []


def test_times_of_two_effects_may_be_the_same_and_of_three_alike_each_pair_is_said():
    two = (SimpleNamespace(name="v", times=("tau1",)), SimpleNamespace(name="w", times=("tau1",)))
    free = ("effects.v.tau1", "effects.w.tau1")
    assert warnings_of(made(effects=two, free=free, values=dict.fromkeys(free, 3.0))) == []
    free = tuple(f"effects.v.tau{i}" for i in (1, 2, 3))
    values = dict.fromkeys(free, 3.0) | {f"effects.v.g{i}": 0.1 for i in (1, 2, 3)}
    assert len(warnings_of(made(effects=RELAXES, free=free, values=values))) == 3


def test_numerical_checks_are_told_at_their_worst():
    numerics = {"p": {"hourglass": 0.02, "inertia": 0.001}, "q": {"hourglass": 0.0312}}
    expected = "Simulations at worst: hourglass 3.12%, inertia 0.10% (of strain energy, of the probe's radius, of "
    assert advice.numerics_sentence(made(numerics=numerics)) == expected + "strain energy)."
    assert advice.numerics_sentence(made()) == ""
    assert "penetration 0.00%" in advice.numerics_sentence(made(numerics={"p": {"penetration": 0.0}}))


@pytest.mark.parametrize(("chi2", "counted"), [(1.5, False), (1.5001, True), (4.0, True)])
def test_a_misfit_counts_beyond_one_and_a_half_of_a_recorded_noise(chi2, counted):
    found = made(channels={KEY: score(chi2)})
    assert advice.misfits(found) == ({KEY: pytest.approx(math.sqrt(chi2))} if counted else {})
    assert advice.misfits(made(channels={KEY: score(chi2)}, groups={KEY: "N"})) == {}


@pytest.mark.parametrize(("times", "channel", "of_note"), [
    (0.99, "force", False), (1.01, "force", True), (0.99, "a/b/c", False), (1.01, "a/b/c", True),
    (0.01, "markers", True), (1.01, "markers", True),
])  # fmt: skip
def test_a_misfit_is_of_note_from_half_a_percent_of_the_largest_value_beyond_the_noise(times, channel, of_note):
    """Of even steps up to 1000 and an outlier the 98 % quantile is 980; of an error of twice the noise three quarters
    of the square lie beyond it."""
    key, size = f"r/{channel}", times * 0.005 * 980.0 / math.sqrt(0.75)
    found = made(recordings=[recording(channel)], channels={key: score(4.0, size)})
    assert advice.of_note(found) == ({key: 2.0} if of_note else {})
    assert advice.of_note(made(channels={key: score(1.0, 1e9)})) == {}


@pytest.mark.parametrize(("rho", "n", "shape", "white"), [
    (0.1999, 100, (100,), True),
    (0.2, 100, (100,), False),  # two standard deviations of a tenth
    (-0.9, 100, (100,), True),
    (0.0, 30, (100,), True),
    (0.0, 29, (100,), False),
    (0.0, 100, (100, 3), False),  # neighbours are no neighbours in time
    (0.36, 30, (100,), True),
    (0.37, 30, (100,), False),
])  # fmt: skip
def test_what_scatters_from_sample_to_sample_is_no_missing_physics(rho, n, shape, white):
    found = made(recordings=[recording(shape=shape)], channels={KEY: score(9.0, 90.0, n, rho)})
    noise, beyond = advice.scattered(found), advice.beyond_noise(found)
    assert noise == ({KEY: 3.0} if white else {})
    assert beyond == ({} if white else {KEY: 3.0})
    parted = made(recordings=[recording("a/b", shape=shape)], channels={"r/a/b": score(9.0, 90.0, n, rho)})
    assert advice.scattered(parted) == ({"r/a/b": 3.0} if white else {})
    small = made(recordings=[recording(shape=shape)], channels={KEY: score(9.0, 1e-3, n, rho)})
    assert advice.scattered(small) == advice.beyond_noise(small) == {}


@pytest.mark.parametrize(("chi2", "gross"), [(25.0, False), (25.01, True)])
def test_numbers_are_suspect_beyond_five_times_the_noise_at_a_bound_or_where_unstable(chi2, gross):
    found = made(channels={KEY: score(chi2)})
    assert advice.suspicions(found) == ({"misfit": ["the misfit is 5 times the noise"]} if gross else {})
    found = made(
        channels={KEY: score(2.0), "r/g": score(36.0)}, at_bound={"a": "lower", "b": "upper"}, stability=unstable(1.1)
    )
    bounds, said = ["a ended at its lower bound", "b ended at its upper bound"], "the misfit is 6 times the noise"
    energy = "the fitted energy is unstable inside the recorded range"
    assert advice.suspicions(found) == {"at a bound": bounds, "unstable": [energy], "misfit": [said]}
    assert advice.suspect(found) == [*bounds, energy, said]
    assert advice.suspect(made(channels={})) == []


@pytest.mark.parametrize(("ratios", "groups", "dof", "said"), [
    ((0.5, 0.99), (), 9.0, "only 0.99 times the recorded noise: check the noise level"),
    ((0.5, 0.7), (), 9.0, "only 0.70 times"),
    ((0.5, 1.0), (), 9.0, None),
    ((0.5, 0.7), (), math.inf, None),  # the stated noise was believed
    ((0.5, 1.1), (1,), 9.0, "only 0.50 times"),  # an estimated level tells nothing
    ((0.5, 1.1), (0, 1), 9.0, None),
])  # fmt: skip
def test_residuals_below_the_recorded_noise_are_said_where_all_are(ratios, groups, dof, said):
    keys = [KEY, "r/g"]
    found = made(
        channels={k: score(x**2) for k, x in zip(keys, ratios, strict=True)}, dof=dof,
        groups={keys[i]: "N" for i in groups}, std=dict.fromkeys(keys, 1.0),
    )  # fmt: skip
    told = [text for text in warnings_of(found) if "recorded noise" in text]
    assert len(told) == (said is not None)
    assert said is None or said in told[0]


@pytest.mark.parametrize(("n", "shown"), [(1, 1), (6, 6), (7, 6), (8, 6)])
@pytest.mark.parametrize(("size", "rho", "why"), [
    (900.0, 0.9, "the model lacks something. Standard errors were widened accordingly."),
    (900.0, 0.0, "what is left scatters from sample to sample, which missing physics does not: check the noise level."),
    (1e-9, 0.9, "by less than 0.5% of the largest value, which is of no note; is the noise level right?"),
])  # fmt: skip
def test_a_misfit_is_told_with_the_six_worst_channels_and_why(n, shown, size, rho, why):
    channels = {f"r/c{i}": score((i + 2.0) ** 2, size, rho=rho) for i in range(n)}
    found = made(recordings=[recording(*(f"c{i}" for i in range(n)))], channels=channels, dof=9.0)
    said = next(text for text in warnings_of(found) if text.startswith("The misfit exceeds the noise"))
    worst = ", ".join(f"r/c{i} {i + 2.0:.1f} times" for i in range(n - 1, n - 1 - shown, -1))
    assert said.startswith(f"The misfit exceeds the noise ({worst}{', ...' if n > 6 else ''}): {why}")


@pytest.mark.parametrize(("rho", "said"), [
    (0.4999, None),
    (0.5, "Residuals of r/force are serially correlated (0.50 from one sample to the next), so samples are not "
          "independent and the standard errors are too small, by up to about 1.7 times."),
    (0.9, "too small, by up to about 4.4 times."),
    (1.0, "(1.00 from one sample to the next), so samples are not independent and the standard errors are too small, "
          "by up to about 44.7 times."),
])  # fmt: skip
def test_correlated_residuals_are_said_from_a_half_on(rho, said):
    """sqrt((1 + rho) / (1 - rho)), rho 0.999 at most; of the worst channel."""
    found = made(channels={"q/x": score(rho=-0.9), KEY: score(rho=rho), "s/x": score(rho=0.3)})
    told = warnings_of(found)
    assert len(told) == (said is not None)
    assert said is None or told[0].endswith(said)
    assert advice.mean_factor(0.28) == pytest.approx(4 / 3)
    found = made(channels={KEY: score(rho=0.8)}, serial=True, inflation=np.array([1.0, 6.25, 4.0]))
    assert warnings_of(found)[0].endswith("the standard errors allow for it and are up to 2.5 times larger.")
    for what in ({"serial": True}, {"inflation": np.ones(1)}):
        assert "too small, by up to about 3.0 times" in warnings_of(made(channels={KEY: score(rho=0.8)}, **what))[0]


@pytest.mark.parametrize(("inside", "held", "times"), [
    ((1.0, 0.5), 4.0, None),
    ((1.0, 0.5), 4.01, 2.0),
    ((0.25,), 4.0, None),
    ((0.25,), 4.41, 4.2),
    ((0.0,), 100.0, None),
    ((1.44, 1.0), 5.76, None),
    ((1.44, 1.0), 12.96, 3.0),
    ((), 100.0, None),
])  # fmt: skip
def test_a_held_out_channel_is_said_from_twice_the_error_of_the_worst_fitted_one(inside, held, times):
    channels = {f"r/{i}": score(c) for i, c in enumerate(inside)}
    told = warnings_of(made(channels=channels, holdout={"h/x": score(0.1), "h/y": score(held)}))
    expected = f"h/y (held out) is predicted {times:.1f} times worse than the fitted recordings: " if times else ""
    assert told == ([expected + "the parameters do not carry over to it."] if times else [])


@pytest.mark.parametrize(("starts", "alone"), [
    ([7.0], None),
    ([7.0, 7.0 * 1.00099], None),
    ([7.0 * 1.00101, 7.0], 2),
    ([0.0, 0.9e-9], None),
    ([0.0, 1.1e-9], 2),
    ([7.0, math.nan, math.inf], 3),
    ([math.nan, math.inf], None),
    ([8.0, 7.0, 7.0, 9.0], None),
    ([], None),
])  # fmt: skip
def test_a_best_end_that_one_start_alone_reached_is_said(starts, alone):
    told = warnings_of(made(starts=starts))
    expected = f"Only 1 of {alone} starts reached the best fit: there are other minima; raise --multistart to be surer."
    assert told == ([expected] if alone else [])
