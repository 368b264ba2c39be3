"""A stored run played back: between its states, with its force and its probe, and over again."""

import h5py
import jax.numpy as jnp
import numpy as np
import pytest

from tests.cutting import slabs
from tests.surrogate import made
from tissuejax.errors import InputError
from tissuejax.play.stored import Run, RunSession
from tissuejax.surrogate.live.direct import direct_scene
from tissuejax.tled import simulate
from tissuejax.tled.stream import run_to_file


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    scene = direct_scene(made.matter(), made.SMALL, np.zeros(2))
    t = np.array([0.0, 0.04])
    down = np.array([[0, 0, 0.0182], [0, 0, 0.0172]])
    changes = {"clock.frames": 8, "clock.interval": 0.005, "probe.time": t, "probe.position": down}
    steps = int(np.ceil(0.005 / float(scene.clock.step)))
    scene = scene.put({k: jnp.asarray(v, jnp.float32) if k[:5] == "probe" else v for k, v in changes.items()})
    return run_to_file(scene.put({"clock.steps": steps}), tmp_path_factory.mktemp("run") / "run.h5", chunk=2)


def test_it_goes_through_its_states_and_forces_and_between_them_straight(path):
    run = Run(path)
    assert len(run.times) == len(run.states) == 4
    assert np.array_equal(run.shape(run.times[1]), run.states[1])
    half = run.shape((run.times[1] + run.times[2]) / 2)
    assert half == pytest.approx((run.states[1] + run.states[2]) / 2, abs=1e-7)
    assert np.array_equal(run.force_at(run.force_times[5]), run.force[5])
    assert run.force[-1, 2] > 0.005  # pressed
    assert run.radius == pytest.approx(4e-3)
    assert run.probe_at(0.02) == pytest.approx([0, 0, 0.0177], abs=1e-6)


def test_it_plays_over_and_over_and_carries_force_probe_and_nodes(path):
    session = RunSession(Run(path), "run")
    first, last = session.run.times[[0, -1]]
    session.advance(0.7 * (last - first))
    once = np.frombuffer(session.frame(1), "<f4")
    session.advance(last - first)
    assert np.frombuffer(session.frame(1), "<f4") == pytest.approx(once, abs=1e-6)
    assert once[6] == pytest.approx(session.run.force_at(session.clock)[2], rel=1e-5)
    assert once[3] == pytest.approx(session.run.probe_at(session.clock)[2])
    assert once[9] == len(once) - 10 == session.run.points.size
    assert session.model["radius"] == pytest.approx(4e-3)


def test_a_file_without_states_is_refused(path, tmp_path):
    with pytest.raises(InputError, match="not a stored run"):
        Run(tmp_path / "none.h5")
    short = tmp_path / "short.h5"
    short.write_bytes(path.read_bytes())
    with h5py.File(short, "a") as file:
        for k in ("1", "2", "3"):
            del file[f"states/displacement/{k}"]
    with pytest.raises(InputError, match="1 states at 4 times"):
        Run(short)


@pytest.mark.slow
def test_a_cutting_plays_back_with_the_force_on_its_blade(tmp_path):
    scene = slabs.cut(strength=3000.0, frames=24)
    seen = simulate.run(scene)
    run = Run(run_to_file(scene, tmp_path / "cut.h5", chunk=6))
    assert len(run.times) == 4
    np.testing.assert_allclose(run.force, np.asarray(seen.force), rtol=1e-6, atol=1e-9)
    assert np.min(run.force[:, 0]) < -1e-4  # the tissue holds the blade back
    opened = np.ptp([run.states[k][:, 1] for k in (0, -1)], axis=0).max()
    assert opened > 2e-4  # and is open where the blade has passed
    session = RunSession(run, "a cut")
    session.advance(0.5 * (run.times[-1] - run.times[0]))
    assert np.isfinite(np.frombuffer(session.frame(1), "<f4")).all()
