"""Intervals against closed forms: a law linear in its constants has a normal posterior and a known evidence."""

import json
import math
from importlib.util import find_spec

import numpy as np
import pytest
from scipy.stats import norm

import tissuejax as tj
from tests.specimens import recording
from tissuejax.cli import main
from tissuejax.errors import InputError
from tissuejax.fitting.profile import profile
from tissuejax.recordings.hdf5_writing import write
from tissuejax.recordings.recording import Channel, Recording, Sample

ONCE = tj.Search(multistart=1)

STRETCH = np.linspace(0.8, 1.35, 40)
X = STRETCH - STRETCH**-2  # P = mu X, and P = 2 C10 X + 2 C01 X / l
SIGMA = 60.0
BAYES = pytest.mark.skipif(
    find_spec("arviz") is None or find_spec("blackjax") is None, reason="the extra `bayes` is not installed"
)


def sample(scale=1.0):
    rng, time = np.random.default_rng(7), np.arange(40.0)
    noise = rng.normal(size=40)
    noise *= scale * SIGMA * math.sqrt(40) / np.linalg.norm(noise)
    made = recording("pull", "uniaxial", time, STRETCH)
    channel = Channel(time, 800 * X + noise, "Pa", SIGMA)
    return Sample("s", {"pull": Recording("pull", "uniaxial", made.inputs, {"nominal_stress": channel}, {})})


@pytest.fixture(scope="module")
def found():
    return tj.fit(sample(0.95), "mooney-rivlin", search=ONCE)


def covariance():
    """Of (C10, C01), by hand."""
    J = np.stack([2 * X, 2 * X / STRETCH], 1) / SIGMA
    return np.linalg.inv(J.T @ J)


def test_the_profile_of_a_linear_law_is_the_normal_interval(found):
    std = np.sqrt(np.diag(covariance()))
    for path, s in zip(found.free, std, strict=True):
        low, high = profile(found, path).interval
        # From both sides: the half width itself, not the end against the value.
        assert (high - low) / 2 == pytest.approx(1.959964 * s, rel=0.02)
        assert (high + low) / 2 == pytest.approx(found.values[path], abs=0.02 * s)


@BAYES
@pytest.mark.parametrize("method", ["laplace", pytest.param("nuts", marks=pytest.mark.slow)])
def test_the_posterior_of_a_linear_law_is_normal(found, method):
    from tissuejax.fitting.posterior import laplace, nuts, target_of

    target = target_of(found)
    mode = np.array([found.values[p] for p in found.free])
    drawn = laplace(target, mode, 4000) if method == "laplace" else nuts(target, mode, 600, 2, 200)
    assert not drawn.warnings
    exact = covariance()
    std = np.sqrt(np.diag(exact))
    np.testing.assert_allclose(drawn.flat.mean(0), mode, atol=0.12 * std.max())
    np.testing.assert_allclose(drawn.flat.std(0), std, rtol=0.1)
    rho = exact[0, 1] / std.prod()
    assert np.corrcoef(drawn.flat.T)[0, 1] == pytest.approx(rho, abs=0.05)
    assert set(drawn.arviz().posterior.data_vars) == set(found.free)


@BAYES
def test_few_draws_are_said_to_be_few(found):
    from tissuejax.fitting.posterior import laplace, target_of

    drawn = laplace(target_of(found), np.array([found.values[p] for p in found.free]), 60)
    assert any("draws count" in w for w in drawn.warnings)


@BAYES
def test_a_bound_cuts_the_posterior():
    from tissuejax.fitting.posterior import laplace, target_of

    found = tj.fit(sample(0.95), "neo-hookean", search=ONCE)
    mu, s = found.values["energy.mu"], SIGMA / np.linalg.norm(X)
    cut = tj.fit(
        sample(0.95),
        "neo-hookean",
        search=ONCE,
        unknowns=tj.Unknowns(bounds={"energy.mu": (mu - s, 5000.0)}),
    )
    drawn = laplace(target_of(cut), np.array([cut.values["energy.mu"]]), 8000)
    low, high = drawn.interval()["energy.mu"]
    base = norm.cdf(-1)
    expected = [mu + s * norm.ppf(base + q * (1 - base)) for q in (0.025, 0.975)]
    np.testing.assert_allclose([low, high], expected, atol=0.12 * s)


def test_the_evidence_of_a_linear_law_is_the_integral():
    from tissuejax.fitting.evidence import evidence
    from tissuejax.fitting.target import Target

    found = tj.fit(
        sample(0.95),
        "neo-hookean",
        search=ONCE,
        unknowns=tj.Unknowns(bounds={"energy.mu": (200.0, 2000.0)}),
    )
    s = SIGMA / np.linalg.norm(X)
    best = -0.5 * found.chi2 - 40 * math.log(SIGMA * math.sqrt(2 * math.pi))
    by_hand = best + math.log(s * math.sqrt(2 * math.pi) / 1800.0)
    told = evidence(Target(found.problem), 400, 3)
    assert told.log_evidence == pytest.approx(by_hand, abs=0.15)
    draws = told.draws.ravel()  # of the posterior too: they have moved apart, and lie as the normal law says
    assert len(np.unique(draws)) > 0.9 * len(draws)
    assert draws.mean() == pytest.approx(found.values["energy.mu"], abs=0.15 * s)
    assert draws.std() == pytest.approx(s, rel=0.1)
    prior = tj.fit(
        sample(0.95),
        "neo-hookean",
        search=ONCE,
        unknowns=tj.Unknowns(priors={"energy.mu": (900.0, 150.0)}),
    )
    assert found.chi2_per_dof == pytest.approx(found.chi2 / 39)
    assert prior.chi2_per_dof == pytest.approx(prior.chi2 / 40)  # what was known beforehand counts as a datum
    data = sample(0.95).recordings["pull"].channels["nominal_stress"].values
    cov = SIGMA**2 * np.eye(40) + 150.0**2 * np.outer(X, X)
    r = np.asarray(data) - 900 * X
    by_hand = -0.5 * (r @ np.linalg.solve(cov, r) + np.linalg.slogdet(cov)[1] + 40 * math.log(2 * math.pi))
    assert evidence(Target(prior.problem), 400, 3).log_evidence == pytest.approx(by_hand, abs=0.15)
    narrow = tj.fit(sample(0.95), "neo-hookean", search=ONCE, unknowns=tj.Unknowns(priors={"energy.mu": (800.0, s)}))
    weak = evidence(Target(narrow.problem), 4000, 3)
    assert weak.rungs == 1  # so wide beside the prior that one step leads there: the mean over draws of the prior
    cov, r = SIGMA**2 * np.eye(40) + s**2 * np.outer(X, X), np.asarray(data) - 800 * X
    by_hand = -0.5 * (r @ np.linalg.solve(cov, r) + np.linalg.slogdet(cov)[1] + 40 * math.log(2 * math.pi))
    assert weak.log_evidence == pytest.approx(by_hand, abs=0.03)
    assert weak.draws.std() == pytest.approx(s / math.sqrt(2), rel=0.05)  # as much is known from both
    with pytest.raises(InputError, match="proper priors"):
        evidence(Target(tj.fit(sample(), "neo-hookean", search=ONCE).problem))


def test_a_misfit_widens_the_posterior_as_it_widens_the_errors():
    from tissuejax.fitting.posterior import target_of

    found = tj.fit(sample(3.0), "neo-hookean", search=ONCE)
    assert found.chi2_per_dof > 5
    target = target_of(found)
    mode = np.array([found.values["energy.mu"]])
    slope = target.box.bounded(target.start(mode))[1]
    assert math.sqrt(target.covariance(mode)[0, 0]) * slope[0] == pytest.approx(found.std["energy.mu"], rel=1e-6)


def test_profile_verb_writes_intervals_and_a_figure(tmp_path, capsys):
    write(sample(), tmp_path / "s.h5")
    command = ["profile", str(tmp_path / "s.h5"), "-e", "neo-hookean", "--multistart", "1"]
    assert main([*command, "-o", str(tmp_path / "out"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["profiles"]["energy.mu"]
    assert told["interval"][0] < told["value"] < told["interval"][1]
    assert (tmp_path / "out" / "profiles.png").is_file()
    assert main([*command, "--path", "energy.nu", "-o", str(tmp_path / "out")]) == 2
