"""Likelihoods, criteria and weights of fits side by side, worked out apart from records made up."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from tissuejax.errors import InputError
from tissuejax.fitting.comparison import compare, name_of


def channel(rmse, n, unit="Pa"):
    return {"rmse": rmse, "n": n, "unit": unit}


def record(name="a", free=2, chi2_per_dof=1.3, **what):
    """A record with two channels in pascals and one in newtons, the second of the first and the third not recorded."""
    parameters = {f"energy.{i}": {"free": i < free, "at_bound": None} for i in range(free + 1)}
    made = {
        "sample": "s",
        "energy": {"name": name},
        "effects": [],
        "status": "converged",
        "data": "d",
        "parameters": parameters,
        "noise": {
            "r/x": {"std": 2.0, "estimated": False},
            "q/x": {"std": 0.7, "estimated": True},
            "p/x": {"std": 0.3, "estimated": True},
            "r/f": {"std": 0.1, "estimated": True},
        },
        "channels": {
            "r/x": channel(2.5, 40), "q/x": channel(1.5, 20), "p/x": channel(0.6, 50), "r/f": channel(0.4, 30, "N"),
        },
        "holdout": {},
        "chi2_per_dof": chi2_per_dof,
        "not_identified": [],
    }  # fmt: skip
    return made | what


def residuals(rmse: float, n: int) -> np.ndarray:
    return np.full(n, rmse)


def test_the_deviance_is_that_of_normal_residuals_with_the_best_level_of_every_unit():
    """Levels that were not recorded keep the ratio that they are stated in; each unit's common factor is its best."""
    (row,) = compare({"a": record()}).rows
    deviance = -2 * np.sum(norm.logpdf(residuals(2.5, 40), scale=2.0))
    shared = math.sqrt((20 * (1.5 / 0.7) ** 2 + 50 * (0.6 / 0.3) ** 2) / 70)
    for rmse, n, std in ((1.5, 20, 0.7 * shared), (0.6, 50, 0.3 * shared), (0.4, 30, 0.4)):
        deviance += -2 * np.sum(norm.logpdf(residuals(rmse, n), scale=std))
    assert row.deviance == pytest.approx(deviance)
    k, n = 2 + 2, 140  # two parameters, a level of each unit
    assert (row.free, row.n) == (2, n)
    assert row.aic == pytest.approx(deviance + 2 * k)
    assert row.aicc == pytest.approx(deviance + 2 * k + 2 * k * (k + 1) / (n - k - 1))
    assert row.bic == pytest.approx(deviance + k * math.log(n))
    assert row.chi2_per_dof is None
    assert row.weight == 1.0


@pytest.mark.parametrize(("n", "finite"), [(6, True), (5, False), (4, False)])
def test_with_hardly_more_samples_than_parameters_the_small_sample_correction_is_infinite(n, finite):
    """Four parameters need six samples: n - k - 1 is one."""
    known = {"r/x": {"std": 2.0, "estimated": False}}
    (row,) = compare({"a": record(free=4, noise=known, channels={"r/x": channel(2.0, n)})}).rows
    assert math.isfinite(row.aicc) == finite
    if finite:
        assert row.aicc == pytest.approx(row.aic + 2 * 4 * 5 / 1)
    assert row.chi2_per_dof == 1.3


def test_weights_are_those_of_the_deviance_over_the_least_misfit():
    known = {"r/x": {"std": 2.0, "estimated": False}}
    made = {
        name: record(name, free, chi2, noise=known, channels={"r/x": channel(rmse, 50)})
        for name, free, chi2, rmse in (("one", 1, 2.0, 2.8), ("two", 2, 1.6, 2.5), ("six", 6, 1.7, 2.49))
    }
    found = compare(made, {"seven": "it failed"})
    assert found.inflation == 1.6
    quasi = {r.name: r.deviance / 1.6 + 2 * r.free for r in found.rows}
    shares = {k: math.exp(-0.5 * (x - min(quasi.values()))) for k, x in quasi.items()}
    assert {r.name: r.weight for r in found.rows} == pytest.approx(
        {k: x / sum(shares.values()) for k, x in shares.items()}
    )
    assert [r.name for r in found.rows] == sorted(quasi, key=quasi.get)
    assert found.best is found.rows[0]
    assert found.failed == {"seven": "it failed"}
    assert found.record()["rows"][0]["name"] == found.best.name
    assert found.sample == found.record()["sample"] == "s"


@pytest.mark.parametrize(("chi2", "expected"), [((0.4, 0.9), 1.0), ((1.5, 1.2), 1.2), ((None, 3.0), 3.0)])
def test_a_misfit_that_all_share_is_at_least_one(chi2, expected):
    known = {"r/x": {"std": 2.0, "estimated": False}}
    made = {f"m{i}": record(f"m{i}", 1, c, noise=known, channels={"r/x": channel(2, 9)}) for i, c in enumerate(chi2)}
    assert compare(made).inflation == expected


def test_of_levels_that_were_not_recorded_no_misfit_is_known():
    assert compare({"a": record(chi2_per_dof=7.0)}).inflation == 1.0


def test_errors_are_over_all_samples_of_a_unit():
    held = {"h/x": channel(3.0, 10), "g/x": channel(1.0, 30), "h/f": channel(0.2, 7, "N")}
    (row,) = compare({"a": record(holdout=held)}).rows
    assert row.held == pytest.approx({"Pa": math.sqrt((90 + 30) / 40), "N": 0.2})
    squares = 40 * 2.5**2 + 20 * 1.5**2 + 50 * 0.6**2
    assert row.fitted == pytest.approx({"Pa": math.sqrt(squares / 110), "N": 0.4})
    assert compare({"a": record()}).rows[0].held == {}


def test_what_is_wrong_with_a_fit_stands_in_its_row():
    bounds = {"energy.mu": {"free": True, "at_bound": "lower"}, "energy.k": {"free": True, "at_bound": None}}
    made = record(parameters=bounds, not_identified=["k is not seen"], status="stopped", effects=["slack", "drift"])
    (row,) = compare({"a": made}).rows
    assert row.warnings == ("energy.mu at its lower bound", "k is not seen")
    assert row.status == "stopped"
    assert name_of(made) == "a + slack + drift"


def test_what_can_not_be_compared_is_refused_by_name():
    with pytest.raises(InputError, match="nothing to compare: no fit gave an answer; it burst; it froze"):
        compare({}, {"a": "it burst", "b": "it froze"})
    with pytest.raises(InputError, match="b: its result does not say"):
        compare({"a": record(), "b": record(data=None)})
    with pytest.raises(InputError, match="a and c were fitted to different data"):
        compare({"a": record(), "b": record(), "c": record(data="e")})
