"""The next press: variations of a path, what counts as telling apart, and (slow) a real pair of explanations."""

import numpy as np
import pytest

from tests.probing import bench
from tissuejax.diagnosis.next_probing import DEEPER, presses, probing_proposals, told_apart
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.refit import Refit
from tissuejax.energies.catalogue import energy
from tissuejax.estimation.series import Segment


@pytest.fixture
def planned():
    return presses(bench.recording(), touch=bench.SIZE[2] + 8e-3)


def test_presses_are_what_they_are_called(planned):
    r = bench.recording()
    old = np.asarray(r.inputs["probe/position"])
    touch = bench.SIZE[2] + 8e-3
    for text, p in planned.items():
        time, path = (np.asarray(p.inputs[f"probe/{k}"]) for k in ("time", "position"))
        assert np.all(np.diff(time) > 0)
        assert len(time) == len(path)
        assert path[0] == pytest.approx(old[0])
        assert set(p.channels) == set(r.channels)
        for c in p.channels.values():
            assert time[0] < c.time[0] <= c.time[-1] < time[-1]
        long = np.ptp(time) / 2.4
        depth = (touch - path[:, 2].min()) / (touch - old[:, 2].min())
        assert depth == pytest.approx(DEEPER if "deeper" in text else 1.0)
        if "faster" in text:
            assert long == pytest.approx(1 / 3, rel=1e-2)
        if "held" in text or "twice" in text:
            assert long == pytest.approx(2.0, rel=1e-2)
        if "sideways" in text:
            assert np.ptp(path[:, 0]) > 7.9e-3
    np.testing.assert_allclose(planned[next(iter(planned))].channels["markers"].values[3], bench.MARKERS)


def test_a_stiffness_scale_tells_nothing_apart_and_a_shape_does():
    t = np.linspace(0, 1, 50)
    own = [
        Segment("p", "force", "z", slice(0, 50), t, "N", t),
        Segment("p", "markers", "marker 0 z", slice(50, 100), t, "m", t),
    ]
    a = np.concatenate([t**1.5, 1e-3 * t])
    sigma = np.concatenate([np.full(50, 0.01), np.full(50, 1e-5)])
    scaled = a * np.where(np.arange(100) < 50, 1.3, 1.0)
    assert told_apart([a, scaled], own, sigma, 0) < 1e-6
    moved = a + np.where(np.arange(100) < 50, 0.0, 2e-4 * np.concatenate([t, t]))
    assert told_apart([a, moved], own, sigma, 0) > 100
    assert told_apart([a, a], own, sigma, 0) == 0


@pytest.mark.slow
def test_a_stuck_and_a_slipping_base_are_told_apart_by_some_press():
    settings = {k: getattr(bench.QUICK, k) for k in ("mesh", "interval", "step", "stiffness_damping", "processes")}
    s = bench.sample(bench.recording("r1"), bench.recording("r2", place=(0.004, 0.0)))
    on = ProbingBench.of(s, energy("reduced-polynomial-2"), ("r1",), ("r2",), ["friction", "base-slip"], **settings)
    base = dict(bench.VALUES)

    def refit(name: str, **values) -> Refit:
        own = {f"effects.{name}.{k}": v for k, v in values.items()}
        return Refit((name,), {**base, **own}, {}, {}, (), 1.0, 1, 1.0, 1, True, on.y)

    slip = {on.candidates["base-slip"].amplitudes[0].split(".")[-1]: 1e-3}
    found = probing_proposals(s, on, refit("friction", coefficient=0.5), refit("base-slip", **slip))
    assert len(found) == 3
    assert found[0].discrimination >= found[-1].discrimination >= 0
    assert found[0].between == ("friction", "base-slip")
    assert "chi-square" in found[0].as_dict()["sentence"]
