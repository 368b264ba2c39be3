"""What is noise and what is not: correlated noise is no rest, a level stated too low is none, spikes are one."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from tissuejax.diagnosis.diagnose import asked_of, diagnose
from tissuejax.diagnosis.judgement.coloured import means_covariance
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.reweigh import Found, reweighed
from tissuejax.estimation.noise import Noise
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.report.judged_sentences import sure

MU, NOISE, STEP = 900.0, 6.0, 0.05
QUICK = Effort(most=1, singles=4, reshaped=(1, 0, 0), starts=1)


@pytest.mark.parametrize("order", [1, 2])
def test_the_covariance_of_means_is_the_mean_of_the_covariance(rng, order):
    time = np.cumsum(rng.uniform(0.01, 0.4, 60))
    sigma, starts = rng.uniform(0.5, 2, 60), np.array([0, 1, 9, 30, 31, 52])
    noise = Noise.shaped(0.7, 0.6, order=order)
    averages = np.zeros((len(starts), len(time)))
    for k, (a, b) in enumerate(zip(starts, [*starts[1:], len(time)], strict=True)):
        averages[k, a:b] = 1 / (b - a)
    lag = np.abs(time[:, None] - time) / 0.6
    alike = np.exp(-lag) if order == 1 else (1 + lag) * np.exp(-lag)
    dense = (0.7 * alike + 0.3 * np.eye(60)) * np.outer(sigma, sigma)
    assert np.allclose(means_covariance(noise, time, sigma, starts), averages @ dense @ averages.T, rtol=1e-10)


def recorded(disturbed, stated=NOISE) -> Sample:
    """Pulls and pushes with holds of a neo-Hookean specimen in closed form, and what `disturbed` makes of them."""
    rng, made = np.random.default_rng(11), {}
    for name, far, ramp in (("slow", 1.3, 6.0), ("quick", 1.25, 1.0), ("push", 0.8, 2.5), ("last", 1.2, 1.5)):
        time = np.arange(0, 3 * ramp + 12, STEP)
        stretch = np.interp(time, [0, 1, 1 + ramp, 9 + ramp, 9 + 2 * ramp], [1, 1, far, far, 1])
        y = disturbed(rng, time, MU * (stretch - stretch**-2))
        channel = Channel(time, y, "Pa", stated)
        told = {"area": 1e-4, "height": 0.01}
        made[name] = Recording(name, "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": channel}, told)
    return Sample("noise", made)


def carried(rng, time, stress, rho=0.9):
    """First-order recursion of unit variance (Jones 1980), times the stated level."""
    e = np.zeros(len(time))
    e[0] = rng.standard_normal()
    for i in range(1, len(time)):
        e[i] = rho * e[i - 1] + np.sqrt(1 - rho**2) * rng.standard_normal()
    return stress + NOISE * e


def filtered(rng, time, stress):
    """Behind a Butterworth filter of second order at an eighth of the sampling rate's half, of the stated level."""
    b, a = butter(2, 0.125)
    answer = lfilter(b, a, np.eye(1, 500)[0])
    drawn = lfilter(b, a, rng.standard_normal(500 + len(time)))[500:]
    return stress + NOISE * drawn / np.sqrt(answer @ answer)


def hummed(kind, frequency):
    """Noise of a kind under a hum of twelve times its size, that hides in the base's residual how it is carried."""
    return lambda rng, time, s: kind(rng, time, s) + 12 * NOISE * np.sin(2 * np.pi * frequency * time + 0.4)


def spiky(rng, time, stress):
    hit = rng.random(len(time)) < 0.06
    return stress + NOISE * (rng.standard_normal(len(time)) + 40 * hit * rng.standard_normal(len(time)))


def waxing(rng, time, stress):
    return stress * (1 + 0.15 * np.sin(2 * np.pi * time / 11 + 1.0)) + NOISE * rng.standard_normal(len(time))


TRIED = ("drift", "periodic", "load-cell-bend", "viscoelasticity")


def asked(sample):
    return diagnose(sample, "neo-hookean", effects=TRIED, effort=QUICK)


@pytest.mark.parametrize("kind", [carried, filtered])
def test_noise_that_is_carried_from_sample_to_sample_is_no_rest(kind):
    answer = asked(recorded(kind))
    assert answer.verdict.kind == "nothing-missing"
    assert answer.as_dict()["rest"]["share_of_peak"] < 0.004


def test_nor_is_it_where_its_level_was_not_recorded():
    """The level is estimated from single samples; in means of many what they share is left over."""
    answer = asked(recorded(carried, stated=None))
    assert answer.verdict.kind == "nothing-missing"
    assert answer.as_dict()["rest"]["share_of_peak"] < 0.004


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "frequency"), [(filtered, 0.7), (carried, 3.0)])
def test_noise_is_read_again_beside_the_mismatch_that_hid_it(kind, frequency):
    sample = recorded(hummed(kind, frequency))
    once = diagnose(sample, "neo-hookean", effects=TRIED, effort=replace(QUICK, readings=0))
    again = asked(sample)
    assert [e["name"] for e in again.as_dict()["effects"]] == ["periodic"]
    assert again.verdict.kind == "found"
    assert again.as_dict()["rest"]["share_of_peak"] < 0.5 * once.as_dict()["rest"]["share_of_peak"]


def test_sets_weighed_again_are_weighed_under_that_noise_too():
    sample = recorded(hummed(carried, 3.0))
    answered = asked(sample).answered
    stored = Found.read(json.loads(json.dumps(Found.of(answered.exploration, answered.evidence.held_out).as_dict())))
    bench = asked_of(sample, "neo-hookean", effects=TRIED)
    evidence = reweighed(bench.whole, *bench.left(), stored, Criteria())
    before = {s.keys: s.log_evidence for s in answered.evidence.sets}
    after = {s.keys: s.log_evidence for s in evidence.sets}
    settled = answered.exploration.effort.course.settled
    assert {k: before[k] for k in after} == pytest.approx(after, abs=2 * settled)


@pytest.mark.parametrize(
    ("disturbed", "verdict", "level"),
    [
        (lambda rng, t, s: s + 1.8 * NOISE * rng.standard_normal(len(t)), "nothing-missing", 1.8),
        pytest.param(spiky, "unexplained", np.sqrt(1 + 0.06 * 40**2), marks=pytest.mark.slow),
    ],
    ids=["stated too low", "spikes"],
)
def test_scatter_up_to_twice_the_stated_level_is_noise_and_spikes_are_not(disturbed, verdict, level):
    answer = asked(recorded(disturbed))
    assert answer.verdict.kind == verdict
    assert answer.verdict.noise_level == pytest.approx(level, rel=0.35)  # a share of each recording's peak
    assert any("check the noise level" in w for w in answer.as_dict()["warnings"])


@pytest.mark.slow
def test_stiffness_that_comes_and_goes_is_no_periodic_load():
    answer = asked(recorded(waxing))
    assert "periodic" not in [e["name"] for e in answer.as_dict()["effects"]]
    assert answer.verdict.kind == "unexplained"
    assert any("a gain that changes while it is recorded" in sentence for sentence in sure(answer))
