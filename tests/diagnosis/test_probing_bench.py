"""The bench of probings on a small box: what needs no run, what is run once, and a shift that is found again."""

from dataclasses import replace

import equinox as eqx
import numpy as np
import pytest

from tests.probing.bench import VALUES, measured, recording, sample
from tissuejax.cache import source
from tissuejax.diagnosis import probing_free
from tissuejax.diagnosis.judgement.particular import SIMULATED
from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_runs import COARSE, FINE, RETIMED
from tissuejax.diagnosis.probing_series import calmed
from tissuejax.diagnosis.probing_view import ProbingView
from tissuejax.diagnosis.refit import refit
from tissuejax.energies.catalogue import energy
from tissuejax.estimation.series import Segment
from tissuejax.experiments import workers
from tissuejax.recordings.recording import Sample

QUICK = {"counts": (12, 12, 5), "core": 0.007, "compression": 1.5, "interval": 0.04, "step": 4e-4, "processes": 1}
TWO = sample(recording("a"), recording("b", place=(-0.004, 0.004), depth=2.5e-3))
DEPTH = 2e-4


def bench_of(given: Sample, keep=None) -> ProbingBench:
    return ProbingBench.of(given, energy("reduced-polynomial-2"), ("a", "b"), (), keep=keep, **QUICK)


@pytest.fixture(scope="module")
def pressed_too_deep() -> Sample:
    """The two recordings as the bench itself predicts them with the probe lower than recorded, and noise."""
    bench, rng = bench_of(TWO), np.random.default_rng(4)
    told = bench.runs._predictor("fine", ()).predict(VALUES | {"effects.contact-offset.depth": DEPTH})
    made = {n: measured(told[n], r, rng) for n, r in TWO.recordings.items()}
    return Sample(TWO.name, made, geometry=TWO.geometry, density=TWO.density)


@pytest.fixture(scope="module")
def bench(pressed_too_deep) -> ProbingBench:
    return bench_of(pressed_too_deep)


def test_an_effect_at_neutral_asks_for_no_run(bench):
    plain = bench.predict(VALUES)
    count = bench.runs.count
    neutral = {"effects.friction.coefficient": 0.0, "effects.inclusion.contrast": 0.0, "effects.inclusion.x": 0.01}
    assert np.array_equal(bench.predict(VALUES | neutral), plain)
    assert bench.runs.count == count


def test_what_acts_in_one_recording_is_run_in_that_one(bench):
    bench.predict(VALUES)
    count = bench.runs.count
    bench.predict(VALUES | {"effects.contact-offset.depth.b": 1e-4})
    assert bench.runs.count == count + 1


@pytest.mark.parametrize(
    ("path", "step", "more"),
    [
        ("effects.contact-offset.depth.a", 3e-4, {}),
        ("effects.machine-compliance.compliance", 5e-4, {}),
        ("effects.support-motion.sin.a", 3e-4, {"effects.support-motion.frequency": 0.9}),
        (
            "effects.support-motion.frequency",
            0.05,
            {"effects.support-motion.sin.a": 3e-4, "effects.support-motion.frequency": 0.9},
        ),
    ],
)
def test_motion_of_probe_support_and_rig_needs_no_run_of_its_own(bench, path, step, more):
    """The derivative from displaced probes against a difference of simulations with the effect in, while the probe is
    held: on the way the contact points of a coarse mesh come in one by one."""
    at = VALUES | more
    now = at.get(path, 0.0)
    low = now if path.endswith("compliance") else now - step  # a rig can't give way against the force
    up, down = bench.runs.many([({**at, path: v}, ("a",), COARSE) for v in (now + step, low)])
    free = probing_free.moving(bench, {path: now} | at, path, ("a",))
    for s in bench.segments:
        if s.recording == "a" and s.label == "force z":
            held = (s.time > 1.2) & (s.time < 1.6)
            true = ((up - down) / (now + step - low))[s.rows][held]
            assert np.linalg.norm(free[s.rows][held] - true) < 0.12 * np.linalg.norm(true)


@pytest.mark.parametrize("path", ["energy.C10", "effects.registration.dx"])
def test_derivatives_can_be_asked_of_the_mesh_that_counts(bench, monkeypatch, path):
    asked, many = set(), bench.runs.many

    def told(jobs):
        asked.update(kind for _, _, kind in jobs)
        return many(jobs)

    monkeypatch.setattr(bench.runs, "many", told)
    cheap = bench.jacobian(VALUES, (path,))
    assert asked == {COARSE}
    asked.clear()
    monkeypatch.setattr(bench, "slopes", FINE)
    dear = bench.jacobian(VALUES, (path,))
    assert asked == {FINE}
    assert 0 < np.linalg.norm(cheap - dear) < 0.5 * np.linalg.norm(dear)


def test_sensors_are_blind_to_each_other(bench):
    at = bench.at(VALUES)
    origin = bench.predict(VALUES)
    for path, blind in (("effects.force-drift.offset_z", "markers"), ("effects.clock-lag.lag", "force")):
        change = probing_free.reported(bench, {path: 0.0} | at, path, 1e-3, origin)
        for s in bench.segments:
            if s.channel == blind:
                assert not np.any(change[s.rows]), path
        assert np.any(change)


@pytest.mark.slow
def test_a_probe_that_is_too_low_is_found_again(bench):
    found = refit(bench, white(bench), ("contact-offset/depth",), {}, iterations=8, tolerance=2.0)
    depth, std = found.values["effects.contact-offset.depth"], found.std["effects.contact-offset.depth"]
    assert abs(depth - DEPTH) < 4 * std
    assert std < 0.2 * DEPTH
    assert found.chi2 < 1.1 * found.n


def test_a_view_is_the_fine_simulation_at_its_anchor_and_weighs_every_channel_alike(bench):
    view = ProbingView.of(bench)
    near = view.anchored(VALUES)
    fine, slow, coarse = (bench.runs.many([(bench.at(VALUES), bench.fitted, k)])[0] for k in (FINE, RETIMED, COARSE))
    late = view._held_back(slow, coarse)
    exact = near.natural(near.predict(VALUES))
    np.testing.assert_allclose(exact, fine + SIMULATED.late * late, rtol=1e-9, atol=1e-12)
    # beside the anchor it changes as the coarse simulation does
    other = VALUES | {"energy.C10": 1.1 * VALUES["energy.C10"]}
    twice = [bench.runs.many([(bench.at(v), bench.fitted, COARSE)])[0] for v in (VALUES, other)]
    change = near.natural(near.predict(other)) - exact
    np.testing.assert_allclose(change, bench.calmed(twice[1] - twice[0]), rtol=1e-6, atol=1e-9)
    for channel in ("force", "markers"):
        rows = np.concatenate([view.y[s.rows] for s in view.segments if s.channel == channel])
        assert 0.9 < np.abs(rows).max() < 2.0


def test_what_comes_late_is_told_from_what_rings(bench):
    """Of a prediction that comes 10 ms late and rings, the delay is taken and the ringing left."""
    view, slow = ProbingView.of(bench), bench.runs.many([(bench.at(VALUES), bench.fitted, RETIMED)])[0]
    moved = np.zeros(len(slow))
    for s in view.segments:
        moved[s.rows] = np.interp(s.time - 0.01, s.time, slow[s.rows]) - slow[s.rows]
    ringing = 0.2 * np.std(moved) * np.sin(3.0 * np.arange(len(slow)))
    found = view._held_back(slow, slow - moved - ringing)
    force = np.concatenate([np.r_[s.rows] for s in view.segments if s.label == "force z"])
    assert np.linalg.norm((found - moved)[force]) < 0.35 * np.linalg.norm(moved[force])
    slope = float(found[force] @ moved[force]) / float(moved[force] @ moved[force])
    assert 0.85 < slope < 1.15


def test_what_rings_is_open_where_it_rings_and_by_its_size(bench, monkeypatch):
    """An oscillation from where the probe stops, on a slow difference: seen there, in its channel, nowhere else."""
    view = ProbingView.of(bench)
    monkeypatch.setattr(bench, "calmed", lambda d: calmed(bench.segments, d, 0.1))  # a wave that takes 0.1 s
    rung, size, s = np.zeros(len(view.y)), 0.01, view.segments[2]
    assert (s.channel, s.component) == ("force", "z")
    stop = s.time[np.argmax(s.drive > 0.99 * s.drive.max())]
    rung[s.rows] = size * (s.time > stop) * np.sin(2.5 * np.arange(len(s.time)))
    drifted = np.concatenate([0.02 * (s.time - s.time[0]) / np.ptp(s.time) for s in view.segments])
    found = view._ringing(rung + drifted)
    later = (s.time > stop + 0.4) & (s.time < s.time[-1] - 0.4)
    assert found[s.rows][later].mean() == pytest.approx(size / np.sqrt(2), rel=0.1)
    calm = s.time < stop - 0.6
    assert found[s.rows][calm].max() < 0.03 * size
    others = np.concatenate([found[o.rows] for o in view.segments if o is not s])
    assert others.max() < 0.03 * size


def test_what_is_open_is_a_column_for_every_channel_of_every_recording(bench):
    near = ProbingView.of(bench).anchored(VALUES)
    pairs = {(s.recording, s.channel) for s in bench.segments}
    fine, slow = (bench.runs.many([(bench.at(VALUES), bench.fitted, k)])[0] for k in (FINE, RETIMED))
    assert set(near.numerical) == {"mesh", "speed", "ringing"}
    for columns in (near.numerical["mesh"], near.numerical["speed"]):
        assert columns.shape == (len(bench.y), len(pairs))
        assert (np.count_nonzero(columns, axis=1) <= 1).all()
    mesh = near.numerical["mesh"].sum(axis=1) * near.unit
    np.testing.assert_allclose(mesh, SIMULATED.remains * bench.calmed(fine - slow), rtol=1e-6, atol=1e-12)


def test_a_wave_between_probe_and_support_is_smoothed_away_and_what_is_slow_stays():
    time, passage = np.arange(0, 8, 0.004), 0.09
    one = Segment("a", "force", "z", slice(0, len(time)), time, "N", np.zeros(len(time)), "depth", "m")
    inner = slice(100, -100)  # series are reflected at their ends
    for period, low, high in ((2 * passage, 0.0, 0.01), (4 * passage, 0.28, 0.31), (40 * passage, 0.98, 1.0)):
        left = np.abs(calmed([one], np.sin(2 * np.pi * time / period), passage)[inner]).max()
        assert low <= left <= high
    assert np.allclose(calmed([one], 3.0 + time, passage)[inner], 3.0 + time[inner])


def test_a_derivative_is_taken_from_nearby_and_anew_farther_off(bench):
    view = ProbingView.of(bench).anchored(VALUES)
    first = view.jacobian(VALUES, ("energy.C10",))
    count, near = bench.runs.count, VALUES | {"energy.C10": 1.01 * VALUES["energy.C10"]}
    again = view.jacobian(near, ("energy.C10",))
    assert bench.runs.count <= count + 2  # what is predicted there, and no displaced simulation
    np.testing.assert_allclose(1.01 * again, first, rtol=1e-9)
    count = bench.runs.count
    view.jacobian(VALUES | {"energy.C10": 1.3 * VALUES["energy.C10"]}, ("energy.C10",))
    assert bench.runs.count == count + 4


def test_where_a_marker_rests_is_known_to_its_noise_over_the_frames_it_was_seen_at_rest(bench):
    view = ProbingView.of(bench)
    for s, shared in zip(view.segments, view.shared, strict=True):
        if s.channel == "force":
            assert shared == 0.0
        else:
            assert 0.1 * view.sigma[s.rows][0] < shared < 0.6 * view.sigma[s.rows][0]


def test_a_correction_is_taken_anew_where_a_set_begins_far_from_it(bench):
    view = ProbingView.of(bench).anchored(VALUES).rooted(VALUES)
    near, far = {**VALUES, "energy.C10": 1.05 * VALUES["energy.C10"]}, {**VALUES, "effects.support-motion.sin.a": 2e-3}
    far["effects.support-motion.frequency"] = 0.3
    assert view.nearer(near).place is view.place
    moved = view.nearer(far)
    fine, slow, coarse = bench.runs.many([(bench.at(far), bench.fitted, k) for k in (FINE, RETIMED, COARSE)])
    assert np.array_equal(moved.place, coarse)
    exact = fine + SIMULATED.late * view._held_back(slow, coarse)
    np.testing.assert_allclose(moved.natural(moved.predict(far)), exact, atol=1e-9)
    force = next(s.rows for s in bench.segments if s.label == "force z" and s.recording == "a")
    missed = (view.natural(view.predict(far)) - exact)[force]
    assert np.linalg.norm(missed) > 0.005 * np.linalg.norm(exact[force])  # 0.5 % of the force, from far away


def test_a_run_that_breaks_down_is_done_again_with_smaller_steps(pressed_too_deep, monkeypatch):
    runs, at, real, asked = bench_of(pressed_too_deep).runs, dict(VALUES), workers.run_all, []

    def breaking(jobs, processes):
        """The first run of each pair bursts."""
        asked.append(jobs)
        done = real(jobs, processes)
        if len(asked) > 1:
            return done
        channels = {n: np.full_like(x, np.nan) for n, x in done[0].channels.items()}
        return [eqx.tree_at(lambda r: (r.failed, r.channels), done[0], (np.asarray(7), channels)), *done[1:]]

    monkeypatch.setattr(workers, "run_all", breaking)
    found = runs.many([(at, ("a", "b"), COARSE)])[0]
    assert [len(jobs) for jobs in asked] == [2, 1]
    monkeypatch.setattr(workers, "run_all", real)
    steps = [p.settings.step for p in runs._models.values()]
    assert min(steps) == pytest.approx(0.5 * max(steps))
    usual = bench_of(pressed_too_deep).runs.many([(at, ("a", "b"), COARSE)])[0]
    rows = runs.rows["a"]
    assert np.array_equal(found[runs.rows["b"]], usual[runs.rows["b"]])
    assert not np.array_equal(found[rows], usual[rows])
    force = next(s.rows for s in runs.segments if s.label == "force z" and s.recording == "a")
    assert np.linalg.norm(found[force] - usual[force]) < 0.02 * np.linalg.norm(usual[force])


def test_a_stopped_diagnosis_finds_its_runs_again(pressed_too_deep, tmp_path, monkeypatch):
    first = bench_of(pressed_too_deep, tmp_path / "runs")
    told = first.predict(VALUES)
    again = bench_of(pressed_too_deep, tmp_path / "runs")
    assert np.array_equal(again.predict(VALUES), told)
    assert again.runs.count == 0
    key = again.runs._key(VALUES, "a", FINE)
    assert again.runs.finished._path(key).exists()
    others = [
        sample(recording("a", depth=3.1e-3), recording("b", place=(-0.004, 0.004), depth=2.5e-3)),
        sample(recording("a", radius=8.1e-3), recording("b", place=(-0.004, 0.004), depth=2.5e-3)),
        Sample(TWO.name, TWO.recordings, geometry=TWO.geometry, density=1.01 * TWO.density),
        Sample(TWO.name, TWO.recordings, replace(TWO.geometry, points=1.01 * TWO.geometry.points), TWO.density),
    ]
    for other in others:  # with the same measurements: y alone tells none of them apart
        measured_alike = {
            n: replace(r, channels=pressed_too_deep.recordings[n].channels) for n, r in other.recordings.items()
        }
        changed = bench_of(replace(other, recordings=measured_alike), tmp_path / "runs")
        assert np.array_equal(changed.y, again.y)
        assert not changed.runs.finished._path(key).exists()
    with monkeypatch.context() as edited:
        edited.setattr(source, "LOADED", "another formula")
        assert not again.runs.finished._path(key).exists()
    again.runs.forget()
    assert not (tmp_path / "runs").exists()
