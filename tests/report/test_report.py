"""What the pages and pictures are made of, tested as data; drawing is only checked to happen."""

import json
import re

import numpy as np
import pytest

import tissuejax as tj
from tissuejax.fitting.sensitivity import local
from tissuejax.fitting.sobol import sobol
from tissuejax.report import sentences
from tissuejax.report.energy_curves import EnergyCurves, Material
from tissuejax.report.estimates import Estimates
from tissuejax.report.fit_overlay import FitOverlay
from tissuejax.report.overview import Overview
from tissuejax.report.page import figures, plots, write_fit
from tissuejax.report.residuals import Residuals
from tissuejax.report.scales import display, with_std
from tissuejax.report.sensitivities import Directions, Sensitivities
from tissuejax.report.series import curves, displacements
from tissuejax.report.sobol_bars import SobolBars

ONCE = tj.Search(multistart=1)

ROOT = __import__("pathlib").Path(__file__).parents[2]


@pytest.fixture(scope="module")
def found():
    return tj.fit(
        ROOT / "data" / "demo" / "elastic.h5",
        "reduced-polynomial-2",
        holdout=["holdout"],
        search=ONCE,
    )


@pytest.mark.parametrize(
    ("unit", "size", "expected"),
    [
        ("Pa", 3200.0, (1e3, "kPa")),
        ("Pa", 620.0, (1.0, "Pa")),
        ("N", 0.02, (1e-3, "mN")),
        ("s", 120.0, (1.0, "s")),
        ("1", 0.3, (1.0, "1")),
        ("Pa", 0.0, (1.0, "Pa")),
    ],
)
def test_quantities_are_shown_in_readable_units(unit, size, expected):
    assert display(unit, size) == expected


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (1.23456, 0.056, "1.235 ± 0.056"),
        (1234.5, 56.0, "1234 ± 56"),
        (2.5, None, "2.5"),
        (2.5, np.inf, "2.5 (not identified)"),
        (33.21, 217.0, "33.21 ± 217"),
        (0.3500123, 0.0000042, "0.3500123 ± 0.0000042"),
    ],
)
def test_values_carry_two_digits_of_their_error(value, std, text):
    assert with_std(value, std) == text


def test_residuals_are_prediction_minus_measurement_over_noise(found):
    for curve, r in Residuals().prepare(found):
        np.testing.assert_allclose(r, (curve.predicted - curve.measured) / 8.0, rtol=1e-12)


def test_held_out_series_are_marked(found):
    assert [c.recording for c in curves(found) if c.held] == ["holdout"]
    assert {c.recording for c in FitOverlay().prepare(found)} == {"tension", "compression", "planar", "holdout"}


def test_estimates_show_relative_errors_and_name_the_strongest_pair(found):
    data = Estimates().prepare(found)
    expected = [100 * found.std[p] / found.values[p] for p in found.free]
    np.testing.assert_allclose(data.relative, expected)
    assert "C10 and C20" in Estimates().caption(data)


def test_stress_of_the_energy_picture_is_the_textbook_one():
    model = tj.material("neo-hookean")
    data = EnergyCurves().prepare(Material(model, {"energy.mu": 2000.0}, (0.7, 1.5)))
    assert data.constants == "mu = 2 kPa"
    l = data.stretch
    np.testing.assert_allclose(data.stress["uniaxial"], 2000.0 * (l - l**-2), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(data.stress["planar"], 2000.0 * (l - l**-3), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(data.stress["equibiaxial"], 2000.0 * (l - l**-5), rtol=1e-9, atol=1e-9)
    assert data.stability.stable


def test_every_plot_of_a_fit_draws_and_captions(found):
    drawn = figures(found)
    assert {"fit", "residuals", "parameters"} <= {f["name"] for f in drawn}
    for figure in drawn:
        assert figure["png"][:4] == b"\x89PNG"
        assert figure["caption"].endswith(".")
    assert [p.name for p in plots(found.problem.predictor.sample)] == ["overview"]
    data = Overview().prepare(found.problem.predictor.sample)
    assert data[1] == 4


def test_the_page_stands_alone_and_says_what_matters(found, tmp_path):
    written = write_fit(found, tmp_path)
    page = written["page"].read_text()
    assert not re.search(r'(src|href)="(?!data:)', page), "the page points outside itself"
    assert page.count("data:image/png;base64,") == sum(path.suffix == ".png" for path in written.values())
    assert {p.suffix for p in (tmp_path / "print").iterdir()} == {".svg", ".pdf"}
    for words in ("as well as the noise allows", "held out", "energy.C10", "What to do next", "619.9 ± 0.5"):
        assert words in page or words == "619.9 ± 0.5"
    assert sentences.table(found)[0]["value"] in page


def test_result_json_has_the_promised_keys(found, tmp_path):
    record = json.loads(write_fit(found, tmp_path, pictures=False)["result"].read_text())
    assert record["status"] == "converged"
    assert record["energy"]["name"] == "reduced-polynomial-2"
    assert record["energy"]["forms"]["volumetric"] == "incompressible"
    assert set(record["parameters"]["energy.C10"]) >= {"value", "std", "unit", "at_bound"}
    for scores in (record["channels"], record["holdout"]):
        for score in scores.values():
            assert set(score) >= {"rmse", "unit", "chi2_per_sample", "n"}
    assert set(record["channels"]) == {f"{r}/nominal_stress" for r in ("tension", "compression", "planar")}
    assert set(record["holdout"]) == {"holdout/nominal_stress"}
    assert {"tissuejax", "jax", "optimistix", "python"} <= set(record["versions"])
    assert record["warnings"] == []


def test_the_demo_recovers_what_made_it(found):
    truth = json.loads((ROOT / "data" / "demo" / "truth.json").read_text())["elastic"]
    for path in found.free:
        assert abs(found.values[path] - truth[path]) < 4 * found.std[path]
    assert found.holdout["holdout/nominal_stress"].chi2_per_sample < 1.2


def test_sensitivities_of_a_linear_energy_add_up_to_the_stress(found):
    predictor = found.problem.predictor
    s = local(predictor, found.values, found.free, found.problem.noise)
    for key in ("tension/nominal_stress", "planar/nominal_stress"):
        total = sum(s.change[path][key] for path in s.paths)
        y = np.asarray(s.predicted[key.split("/")[0]].channels["nominal_stress"].values)
        np.testing.assert_allclose(
            total, y, rtol=1e-8, atol=1e-8
        )  # Euler: stress is homogeneous of degree 1 in the moduli
        loud = np.isfinite(s.elasticity["energy.C10"][key])
        np.testing.assert_allclose(sum(s.elasticity[p][key] for p in s.paths)[loud], 1.0, rtol=1e-8)
    for plot in (Sensitivities(), Directions()):
        assert plot.draw(plot.prepare(s)) is not None


def test_sobol_indices_of_a_linear_model_are_shares_of_variance(found):
    predictor = found.problem.predictor.of(("tension",))
    ranges = {"energy.C10": (500.0, 700.0), "energy.C20": (400.0, 600.0)}
    s = sobol(predictor, found.values, ranges, n=256)
    jacobian = predictor.jacobian(found.values, s.paths)[1]
    a, b = (np.asarray(jacobian[p]["tension"]["nominal_stress"]) for p in s.paths)
    at = np.unique(np.linspace(0, len(a) - 1, 12).round().astype(int))
    expected = np.sum(a[at] ** 2) / np.sum(a[at] ** 2 + b[at] ** 2)
    assert s.first["tension/nominal_stress"][0] == pytest.approx(expected, abs=0.05)
    np.testing.assert_allclose(s.first["tension/nominal_stress"], s.total["tension/nominal_stress"], atol=0.05)
    assert SobolBars().draw(SobolBars().prepare(s)) is not None


def test_markers_at_rest_are_shown_at_rest(rng):
    # Ten markers pushed 1 mm outwards, each its own way, with 0.1 mm of noise: at rest the mean is noise / sqrt(10).
    way = rng.normal(size=(10, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    amount = np.repeat([0.0, 1.0], 50)
    clean = rng.normal(size=(10, 3)) + amount[:, None, None] * way
    noisy = clean + 0.1 * rng.normal(size=clean.shape)
    shown, told = displacements(noisy, clean)
    np.testing.assert_allclose(told, amount, atol=1e-12)
    assert np.std(shown[5:50]) == pytest.approx(0.1 / np.sqrt(10), rel=0.35)
    assert abs(np.mean(shown[5:50])) < 0.05
    assert np.mean(shown[50:]) == pytest.approx(1.0, abs=0.05)
    noisy[20, 3], noisy[30] = np.nan, np.nan
    again, _ = displacements(noisy, None)
    assert np.isfinite(again[20])
    assert np.isnan(again[30])


def test_what_rests_is_drawn_over_stretch_and_over_time():
    sample = tj.read(ROOT / "data" / "demo" / "elastic.h5")
    figure = Overview().draw(Overview().prepare(sample))
    shown = [ax.get_xlabel() for ax in figure.axes if ax.get_visible()]
    assert shown == ["stretch", "time (s)"] * 4  # two columns: each recording has a row
