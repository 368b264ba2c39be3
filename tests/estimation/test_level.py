"""Noise that was not recorded: its level against the truth, on responses that the description doesn't hold exactly."""

import numpy as np
import pytest
from scipy.signal import lfilter

from tissuejax.estimation.level import Response, kinks, levels, resolution, rough
from tissuejax.estimation.sigma import sigmas
from tissuejax.recordings.recording import Channel, Recording, Sample

TIME = np.arange(625) * 0.04
SHARE = TIME / TIME[-1]
DRIVES = {
    "hold": np.interp(SHARE, [0, 0.04, 0.2, 0.6, 0.7, 1], [0, 0, 0.25, 0.25, 0, 0]),
    "cycles": 0.12 * (1 - np.cos(12 * np.pi * SHARE)),
    "ramp": 0.3 * SHARE,
}
STD = 15.0


def relaxing(e, elastic=None):
    """An exponential law that relaxes with 0.7 and 6 s: neither its power nor its times are the description's."""
    elastic = 3000 * (np.exp(3 * e) - 1) / 3 if elastic is None else elastic
    out = elastic.copy()
    for g, tau in ((0.2, 0.7), (0.15, 6.0)):
        kept = np.exp(-0.04 / tau)
        out -= g * (elastic - lfilter([1.0], [1.0, -kept], np.diff(elastic, prepend=0.0)))
    return out


def slack(e):
    """Nothing at first, then an exponential."""
    return 3000 * (np.exp(3 * np.maximum(e - 0.03, 0)) - 1) / 3


def stiffening(e):
    """Tangents 25 times as large at the end as at the beginning, and the same relaxation."""
    return relaxing(e, 3000 * (np.exp(3.2 * e / 0.3) - 1) / 24)


def knee(e):
    """Soft to a strain of 0.15, then 20 kPa a strain, over a hundredth: a sheet whose fibres come taut."""
    return relaxing(e, 200 * np.logaddexp(0, (e - 0.15) / 0.01))


def drawn(kind, rng):
    w = rng.normal(size=1300)
    if kind == "white":
        return w[-625:]
    if kind == "moving average":
        return np.convolve(w, np.ones(5) / np.sqrt(5), "valid")[-625:]
    rho = float(kind)
    return lfilter([np.sqrt(1 - rho**2)], [1, -rho], w)[-625:]


@pytest.mark.parametrize("response", [relaxing, slack, stiffening, knee])
@pytest.mark.parametrize("kind", ["white", "0.5", "0.8", "0.9", "0.95", "moving average"])
def test_levels_within_15_percent_of_the_truth(kind, response):
    found = []
    for trial in range(3):
        rng = np.random.default_rng(trial)
        given = [Response(TIME, e, response(e) + STD * drawn(kind, rng)) for e in DRIVES.values()]
        found.append([x.std for x in levels(given)])
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(STD, rel=0.15)


def test_a_fast_ramp_with_many_samples_before_a_long_hold_with_few():
    """What relaxes within the ramp's time is described at the ramp's sampling, not at a hundredth of the recording."""
    time = np.concatenate([np.arange(0, 0.1, 0.004), 0.1 + np.geomspace(0.004, 40, 75)])
    e = np.interp(time, [0, 0.1, 41], [0, 0.3, 0.3])
    ramps = np.minimum(time, 0.1)  # a stress of rate 1 during the ramp, fading over tau, in closed form
    faded = [tau * (np.exp((ramps - time) / tau) - np.exp(-time / tau)) for tau in (0.03, 0.4)]
    y = 6e3 * (0.4 * e + 3 * (0.3 * faded[0] + 0.3 * faded[1]))
    found = [
        levels([Response(time, e, y + STD * np.random.default_rng(k).normal(size=len(time)))])[0].std for k in range(6)
    ]
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(STD, rel=0.15)


def test_neighbours_alone_tell_of_white_noise_only(rng):
    """What the differences of neighbours give: right within 10 % if white, a quarter if strongly correlated."""
    assert rough(slack(DRIVES["ramp"]) + STD * rng.normal(size=625)) == pytest.approx(STD, rel=0.1)
    assert rough(STD * drawn("0.9", rng)) < 0.4 * STD


@pytest.mark.parametrize("step", [10.0, 40.0])
def test_quantised_ramps(step, rng):
    """Without other noise the error of rounding is uniform, step / sqrt 12; beside it both add up."""
    y = relaxing(DRIVES["ramp"])
    quiet = np.round(y / step) * step
    assert resolution(quiet) == pytest.approx(step)
    (level,) = levels([Response(TIME, DRIVES["ramp"], quiet)])
    assert level.std == pytest.approx(step / np.sqrt(12), rel=0.15)
    noisy = np.round((y + STD * rng.normal(size=625)) / step) * step
    (level,) = levels([Response(TIME, DRIVES["ramp"], noisy)])
    assert level.std == pytest.approx(np.hypot(STD, step / np.sqrt(12)), rel=0.15)
    assert resolution(y) == 0.0
    assert resolution(y + rng.normal(size=625)) == 0.0


def test_kinks_are_where_the_ramp_begins_and_ends():
    found = kinks(TIME, DRIVES["hold"])
    assert found == pytest.approx([25, 125, 374, 437], abs=1)
    assert kinks(TIME, DRIVES["ramp"]) == ()
    assert kinks(TIME, DRIVES["cycles"]) == ()


def sample(values, time=TIME, noise_std=None):
    recordings = {}
    for name, y in values.items():
        inputs = {"time": time, "stretch": 1 + DRIVES["ramp"][: len(time)]}
        recordings[name] = Recording(name, "uniaxial", inputs, {"nominal_stress": Channel(time, y, "Pa", noise_std)})
    return Sample("s", recordings)


def test_a_recorded_level_is_taken_as_it_is(rng):
    y = {"r1": relaxing(DRIVES["ramp"]) + STD * rng.normal(size=625)}
    assert sigmas(sample(y, noise_std=3.0), ("r1",)) == ({"r1": 3.0}, [])


def test_what_an_estimate_rests_on_is_said(rng):
    y = relaxing(DRIVES["ramp"])
    sigma, said = sigmas(sample({"r1": y + STD * rng.normal(size=625), "r2": y + STD * rng.normal(size=625)}), ("r2",))
    assert list(sigma) == ["r2"]
    assert sigma["r2"] == pytest.approx(STD, rel=0.15)
    assert len(said) == 1
    few = {"r1": (y + STD * rng.normal(size=625))[:50]}
    assert "too few samples to tell slow noise" in sigmas(sample(few, TIME[:50]), ("r1",))[1][1]
    steps = sigmas(sample({"r1": np.round(y / 20) * 20}), ("r1",))[1]
    assert any("steps (r1 20 Pa)" in s for s in steps)


def test_a_smooth_rest_that_may_be_filtered_noise_is_said(rng):
    """Behind a filter of second order noise falls as f^-4, as what an elastic law leaves does."""
    behind = lfilter([1.0], [1.0, -0.9], lfilter([1.0], [1.0, -0.9], rng.normal(size=1300)))[-625:]
    y = relaxing(DRIVES["ramp"]) + STD * behind / np.std(behind) + 0.3 * rng.normal(size=625)
    sigma, said = sigmas(sample({"r1": y}), ("r1",))
    assert sigma["r1"] == pytest.approx(STD, rel=0.3) or any("can't be known" in s for s in said)
