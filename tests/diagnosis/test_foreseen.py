"""What fitted recordings leave open in a held-out one: against algebra, against repeated measurements, and said."""

import dataclasses

import numpy as np
import pytest
from spring_bench import CANDIDATES, FREE, spring

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.foreseen import OPEN, foreseen
from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.refit import refit

SIGMA = 0.05


def small_and_large(seed: int = 0, least: float = 0.25):
    """A spring fitted at `least` of the drive that is held out: its cubic term is hardly seen."""
    bench = spring({}, seed=seed, sigma=SIGMA)
    bench.segments = [
        s if s.recording in bench.held_out else dataclasses.replace(s, drive=least * s.drive) for s in bench.segments
    ]
    noise = np.random.default_rng(seed).normal(size=len(bench.y))
    bench.y = bench.predict({"a": 10.0, "b": 20.0}) + SIGMA * noise
    return bench


def design(bench, recordings):
    x = np.concatenate([s.drive for s in bench.segments if s.recording in recordings])
    return np.stack([x, x**3], axis=1)


def test_a_linear_model_s_standard_error_is_the_textbook_s():
    bench = small_and_large()
    misfit = white(bench)
    (found,) = foreseen(bench, misfit, (r := refit(bench, misfit, (), {})))
    X, H = design(bench, bench.fitted), design(bench, bench.held_out)
    C = SIGMA**2 * np.linalg.inv(X.T @ X) * max(1.0, r.chi2 / (r.n - 2))
    expected = np.sqrt(np.mean(np.einsum("ij,jk,ik->i", H, C, H)))
    assert found.std == pytest.approx(expected, rel=1e-4)
    assert found.over_noise == pytest.approx(expected / SIGMA, rel=1e-4)
    assert (found.recording, found.unit, found.path) == ("r3", "N", "b")


def test_it_is_the_scatter_of_predictions_from_repeated_measurements():
    bench = small_and_large()
    X, H = design(bench, bench.fitted), design(bench, bench.held_out)
    truth = np.array([10.0, 20.0])
    rng = np.random.default_rng(1)
    measured = X @ truth + SIGMA * rng.normal(size=(400, len(X)))
    errors = (np.linalg.lstsq(X, measured.T, rcond=None)[0].T - truth) @ H.T
    misfit = white(bench)
    (found,) = foreseen(bench, misfit, refit(bench, misfit, (), {}))
    assert found.std == pytest.approx(np.sqrt(np.mean(errors**2)), rel=0.15)  # 400 draws of two parameters: 4 %


def test_what_the_recording_has_for_itself_takes_its_part_away():
    bench = small_and_large()
    own = Candidate("offset", ("offset.value",), held=("offset.own",))
    bench.candidates = CANDIDATES | {"offset": own}
    bench.free = FREE | {"offset.own": FREE["offset.value"]}
    bench.start = bench.start | {"offset.own": 0.0}
    plain = bench.predict
    held = bench.mask(bench.held_out)
    bench.predict = lambda values, recordings=None: np.where(
        held,
        plain({**values, "offset.value": {**bench.start, **values}["offset.own"]}),
        plain(values),
    )
    misfit = white(bench)
    (found,) = foreseen(bench, misfit, (r := refit(bench, misfit, ("offset",), {})))
    X, H = design(bench, bench.fitted), design(bench, bench.held_out)
    X = np.column_stack([X, np.ones(len(X))])
    C = SIGMA**2 * np.linalg.inv(X.T @ X)[:2, :2] * max(1.0, r.chi2 / (r.n - 3))
    H = H - H.mean(axis=0)
    assert found.std == pytest.approx(np.sqrt(np.mean(np.einsum("ij,jk,ik->i", H, C, H))), rel=1e-4)


def test_recordings_alike_leave_nothing_open_and_nothing_held_out_is_nothing_foreseen():
    bench = spring({}, seed=2, sigma=SIGMA)
    bench.segments = [dataclasses.replace(s, drive=bench.segments[0].drive) for s in bench.segments]
    noise = np.random.default_rng(2).normal(size=len(bench.y))
    bench.y = bench.predict({"a": 10.0, "b": 20.0}) + SIGMA * noise
    misfit = white(bench)
    (found,) = foreseen(bench, misfit, (r := refit(bench, misfit, (), {})))
    least = np.sqrt(r.k / r.n * max(1.0, r.chi2 / (r.n - r.k)))  # parameters over samples, whatever the design
    assert found.over_noise == pytest.approx(least, rel=1e-4)
    assert found.over_noise < OPEN
    alone = spring({}, seed=2, sigma=SIGMA, held_out=())
    misfit = white(alone)
    assert foreseen(alone, misfit, refit(alone, misfit, (), {})) == []


def test_the_sentence_names_recording_parameter_and_what_to_do():
    bench = small_and_large(least=0.1)
    misfit = white(bench)
    (found,) = foreseen(bench, misfit, (r := refit(bench, misfit, (), {})))
    assert found.over_noise > OPEN
    said = found.sentence(r)
    assert said.startswith("r3 asks for")
    assert f"b = {r.values['b']:.3g} +- {r.std['b']:.2g}" in said
    assert "fit such a recording too" in said


def test_what_no_fitted_recording_moves_is_left_out():
    """A parameter that only a prior tells of has a standard error, and no derivative in what was fitted."""
    bench = small_and_large()
    misfit = white(bench)
    r = refit(bench, misfit, (), {})
    (expected,) = foreseen(bench, misfit, r)
    idle = "relax.tau"  # of a relaxation that takes nothing away
    assert not np.any(bench.jacobian(r.all, (idle,), bench.fitted))
    more = dataclasses.replace(r, values={**r.values, idle: 1.0}, std={**r.std, idle: 1.0})
    (found,) = foreseen(bench, misfit, more)
    assert found.path == expected.path
    assert found.std == pytest.approx(expected.std, rel=1 / r.n)  # one parameter more is counted
