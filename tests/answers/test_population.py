"""A population fit against what made the data, and against closed forms where there is one."""

import csv
import json

import jax
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from tissuejax.campaign.population import Estimates, Population, Runner, estimates, log_likelihood, pooled, population
from tissuejax.cli import main
from tissuejax.errors import InputError
from tissuejax.report.population_page import parameters, write_population

pytest.importorskip("numpyro")


def made(rng, n=40, groups=8, error=0.15, between=0.2, among=0.3):
    """Log-normal specimens in groups, one parameter beside one that is plain; measured with errors."""
    group = np.arange(n) % groups
    a = among * rng.normal(size=groups)
    theta = np.stack([np.log(2000.0) + a[group] + between * rng.normal(size=n), 5.0 + 2.0 * rng.normal(size=n)], 1)
    x = theta + np.array([error, 1.5]) * rng.normal(size=(n, 2))
    values = np.stack([np.exp(x[:, 0]), x[:, 1]], 1)
    std = np.stack([error * values[:, 0], np.full(n, 1.5)], 1)
    covariance = np.einsum("ni,ij->nij", std**2, np.eye(2))
    names = tuple(f"s{i}" for i in range(n))
    told = tuple(f"g{g}" for g in group)
    return theta, Estimates(names, ("energy.mu", "energy.c"), values, covariance, np.array([True, False]), told)


def test_working_coordinates_go_there_and_back(rng):
    _, of = made(rng)
    x, S = of.working
    np.testing.assert_allclose(of.natural(x), of.values)
    np.testing.assert_allclose(S[:, 0, 0], 0.15**2, rtol=1e-12)


def test_the_pooled_fit_is_the_weighted_mean(rng):
    _, of = made(rng)
    value, std = pooled(of)
    w = 1 / of.covariance[:, 1, 1]
    assert value[1] == pytest.approx(np.sum(w * of.values[:, 1]) / w.sum())
    assert std[1] == pytest.approx(w.sum() ** -0.5)


def test_with_the_spreads_known_a_specimen_is_the_weighted_mean(rng):
    _, of = made(rng, n=6, groups=2)
    ones = np.ones((500, 1, 1))
    B, m = np.diag([0.04, 4.0]), np.array([7.6, 5.0])
    known = Population(of, np.tile(m, (500, 1)), ones * B, 0 * ones * B, np.zeros((500, 2, 2)), 0, 1.0)
    x, S = of.working
    mean, std = known.specimens()
    weight = 1 / np.diag(B) + 1 / np.einsum("nii->ni", S)
    np.testing.assert_allclose(mean, (m / np.diag(B) + x / np.einsum("nii->ni", S)) / weight)
    np.testing.assert_allclose(std, weight**-0.5)
    new = known.new("g1")
    assert np.std(np.log(new[:, 0])) == pytest.approx(0.2, rel=0.15)
    assert np.std(new[:, 1]) == pytest.approx(2.0, rel=0.15)
    with pytest.raises(InputError, match="g0"):
        known.new("g9")


ROOTS = np.array([[0.5, 0.0], [0.2, 0.7]]), np.array([[0.9, 0.0], [-0.3, 0.4]])


def dense(of: Estimates, m, between, among, seen):
    """Mean and covariance of all effects and all seen estimates stacked, every entry written out."""
    x, S = of.working
    g, at = len(of.labels), np.flatnonzero(seen)
    A, B = among @ among.T, between @ between.T
    prior = np.kron(np.eye(g), A)
    pick = np.kron(np.eye(g)[of.group[at]], np.eye(2))
    own = np.zeros((2 * len(at), 2 * len(at)))
    for k, i in enumerate(at):
        own[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = B + S[i]
    data = x[at].ravel() - np.tile(m, len(at))
    return prior, pick, own, data


def test_what_is_integrated_out_is_the_dense_normal_distribution(rng):
    _, of = made(rng, n=9, groups=3)
    x, S = of.working
    m, seen = np.array([7.5, 4.0]), np.arange(9) % 4 != 1
    prior, pick, own, data = dense(of, m, *ROOTS, seen)
    whole = pick @ prior @ pick.T + own
    got = log_likelihood(m, *ROOTS, x, S, of.group, seen.astype(float), 3)
    assert float(got) == pytest.approx(multivariate_normal.logpdf(data, np.zeros(len(data)), whole), rel=1e-9)
    alone = log_likelihood(m, ROOTS[0], None, x, S, of.group, seen.astype(float), 1)
    assert float(alone) == pytest.approx(multivariate_normal.logpdf(data, np.zeros(len(data)), own), rel=1e-9)


def test_effects_are_drawn_from_their_conditional_distribution(rng):
    _, of = made(rng, n=9, groups=3)
    x, S = of.working
    m, seen = np.array([7.5, 4.0]), np.arange(9) % 4 != 1
    prior, pick, own, data = dense(of, m, *ROOTS, seen)
    gain = prior @ pick.T @ np.linalg.inv(pick @ prior @ pick.T + own)
    n = 20_000
    many = (np.tile(v, (n, *[1] * v.ndim)) for v in (m, *ROOTS))
    drawn = np.asarray(Runner(3).effects(jax.random.split(jax.random.key(0), n), *many, x, S, of.group, seen * 1.0))
    flat, spread = drawn.reshape(n, -1), prior - gain @ pick @ prior
    error = np.sqrt(np.diag(spread) / n)
    assert (np.abs(flat.mean(0) - gain @ data) < 4.5 * error).all()
    np.testing.assert_allclose(np.cov(flat.T), spread, atol=0.05 * np.diag(spread).max())


@pytest.mark.slow
def test_mean_and_spreads_are_found_again_and_specimens_shrink(rng):
    theta, of = made(rng)
    found = population(of, draws=300, warmup=300, chains=2)
    assert found.divergences < 10
    assert found.rhat < 1.05
    low, high = np.quantile(np.sqrt(found.between[:, 0, 0]), [0.005, 0.995])
    assert low < 0.2 < high
    low, high = np.quantile(np.sqrt(found.between[:, 1, 1]), [0.005, 0.995])
    assert low < 2.0 < high
    low, high = np.quantile(np.sqrt(found.between_groups[:, 0, 0]), [0.005, 0.995])
    assert low < 0.3 < high
    shrunken, std = found.specimens()
    x, S = of.working
    # nearer than measurements are by their variance (these may lie nearer by luck), and as near as they say: of 80
    # squares of unit variance the mean lies between 0.59 and 1.53 but for three in a thousand
    variance = np.einsum("nii->ni", S)
    assert (np.mean((shrunken - theta) ** 2, 0) < np.mean(variance, 0)).all()
    assert 0.59 < np.mean(((shrunken - theta) / std) ** 2) < 1.53
    assert (std < np.sqrt(variance) * 1.02).all()
    new = np.log(found.new()[:, 0])
    n = len(set(of.group))
    means = [theta[k::n, 0].mean() for k in range(n)]
    spread = np.std(means, ddof=1) * np.sqrt((1 + 1 / n) * (n - 1) / (n - 3))  # Student's, for a new one of n
    assert np.std(new) == pytest.approx(np.hypot(0.2, spread), rel=0.25)
    known = np.log(found.new("g0")[:, 0])
    assert np.std(known) < np.std(new)


def test_fits_that_say_nothing_are_left_out():
    def record(value, std, bound=None, status="converged"):
        p = {"value": value, "std": std, "at_bound": bound, "free": True, "unit": "Pa"}
        return {
            "status": status,
            "parameters": {"energy.mu": p},
            "correlation": {"paths": ["energy.mu"], "matrix": [[1.0]]},
        }

    rows = {f"s{i}": record(1000.0 + i, 10.0) for i in range(4)}
    rows |= {"bound": record(1.0, 1.0, "lower"), "lost": record(1.0, None), "no": record(1.0, 1.0, status="no")}
    of = estimates(rows)
    assert of.samples == ("s0", "s1", "s2", "s3")
    assert of.left_out == ("bound", "lost", "no")
    assert of.doubtful == {}
    assert of.positive.all()
    assert of.units == ("Pa",)
    np.testing.assert_allclose(of.covariance.ravel(), 100.0)
    rows["s2"]["suspect"] = {"misfit": ["the misfit is 7 times the noise"], "unstable": ["it is unstable"]}
    assert estimates(rows).doubtful == {"s2": "the misfit is 7 times the noise; it is unstable"}
    with pytest.raises(InputError, match="three or more"):
        estimates({"s0": rows["s0"], "bound": rows["bound"]})


def test_the_page_names_specimens_and_keeps_one_unit_a_family(tmp_path):
    """Errors and spread alike: every specimen is half way between its own value and the mean, in logarithms."""
    names, paths, units = ("a1", "a2", "b1"), ("energy.C10", "energy.C20"), ("Pa", "Pa")
    values = np.array([[2000.0, 500.0], [4000.0, 500.0], [8000.0, 500.0]])
    covariance = 0.25 * np.einsum("ni,ij->nij", values**2, np.eye(2))
    doubts = ("", "the misfit is 7 times the noise", "")
    of = Estimates(names, paths, values, covariance, np.ones(2, bool), ("a", "a", "b"), units, doubts, ("c1",))
    many = np.ones((100, 1, 1))
    known = Population(
        of, np.tile(np.log([4000.0, 500.0]), (100, 1)), 0.25 * np.eye(2) * many, 0.04 * np.eye(2) * many,
        np.zeros((100, 2, 2)), 0, 1.0,
    )  # fmt: skip
    files = write_population(known, tmp_path)
    with open(files["specimens"], encoding="utf-8") as file:
        rows = {row["sample"]: row for row in csv.DictReader(file)}
    assert rows["a2"]["suspect"] == "the misfit is 7 times the noise"
    assert (rows["a1"]["group"], rows["b1"]["group"]) == ("a", "b")
    assert float(rows["a1"]["energy.C10 separate (Pa)"]) == pytest.approx(2000)
    assert float(rows["a1"]["energy.C10 population (Pa)"]) == pytest.approx((2000 * 4000) ** 0.5)
    assert float(rows["b1"]["energy.C10 low population (Pa)"]) == pytest.approx(
        (8000 * 4000) ** 0.5 * np.exp(-1.96 * (0.25 / 2) ** 0.5)
    )
    told = parameters(known, known.record())
    assert [row["unit"] for row in told] == ["kPa", "kPa"]
    assert told[1]["typical"] == "0.5 (0.5 to 0.5)"
    assert told[0]["between_specimens"] == "a factor of 1.6 (1.6 to 1.6)"
    assert told[0]["between_groups"] == "20 % (20 % to 20 %)"
    page = files["page"].read_text()
    assert "1 of the 3 fits should not be used as they are" in page
    assert "1 more left out (at a bound, without an error, or not converged): c1" in page
    assert "<td>b1</td>" in page


@pytest.mark.slow
def test_a_population_of_a_campaign(tmp_path, capsys, rng):
    stretch = np.linspace(1.0, 1.3, 20)
    rows = ["specimen,stretch,stress\n"]
    for name, mu in (("pig1-a", 3), ("pig1-b", 3.4), ("pig2-a", 5), ("pig2-b", 5.6), ("pig2-c", 5.2)):
        rows += [f"{name},{l},{mu * (l - l**-2) + 0.01 * rng.normal()}\n" for l in stretch]
    (tmp_path / "lab.csv").write_text("".join(rows))
    (tmp_path / "lab.toml").write_text(
        'file = "lab.csv"\nsample = "{specimen}"\nrecording = "pull"\nexperiment = "uniaxial"\n[columns]\n'
        'stretch = { column = "stretch" }\nnominal_stress = { column = "stress", unit = "kPa" }\n'
    )
    c = str(tmp_path / "c")
    assert main(["campaign", "run", c, str(tmp_path / "lab.toml"), "--energy", "neo-hookean"]) == 0
    assert main(["campaign", "population", c, "--group", "pig9"]) == 2
    capsys.readouterr()
    assert main(["campaign", "population", c, "--group", r"^(pig\d)", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["groups"] == ["pig1", "pig2"]
    low, high = record["new_specimen"]["energy.mu"]["95 %"]
    assert low < 3000
    assert high > 5600
    assert (tmp_path / "c" / "population" / "report.html").stat().st_size > 10_000
