"""The page of a fit says one thing: band, digits, units and verdict, checked as data."""

import csv
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import t as student

import tissuejax as tj
from tests.specimens import ramp, recording
from tissuejax.fitting.advice import beyond_noise, suspect
from tissuejax.fitting.bands import fitted_std, prediction_std
from tissuejax.fitting.probed import numerical_sentence
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.report import sentences
from tissuejax.report.fit_overlay import FitOverlay
from tissuejax.report.fit_tables import write_curves, write_latex
from tissuejax.report.scales import with_std

ONCE = tj.Search(multistart=1)

STRETCH = np.linspace(1.0, 1.4, 60)


def sample(noise, mu=3000.0, seed=1, stated=None):
    rng, time = np.random.default_rng(seed), np.arange(60.0)
    made = recording("pull", "uniaxial", time, STRETCH)
    stress = mu * (STRETCH - STRETCH**-2) + noise * rng.normal(size=60)
    channel = Channel(time, stress, "Pa", stated or noise)
    return Sample("s", {"pull": Recording("pull", "uniaxial", made.inputs, {"nominal_stress": channel}, {})})


@pytest.fixture(scope="module")
def found():
    return tj.fit(sample(10.0), "neo-hookean", search=ONCE)


def test_the_band_is_that_of_a_line_through_the_origin(found):
    # P = mu x, x = l - l^-2: var of the estimate s^2 / sum x^2, so the band of a measured value is by hand.
    x = STRETCH - STRETCH**-2
    widening = max(1.0, found.chi2_per_dof)
    by_hand = 1.959964 * np.sqrt(100.0 * widening * x**2 / np.sum(x**2) + 100.0)
    np.testing.assert_allclose(FitOverlay().prepare(found)[0].band, by_hand, rtol=1e-6)


def test_where_the_noise_was_not_recorded_the_band_is_that_of_student():
    # 6 values, 1 parameter: the textbook's prediction interval of a line through the origin, 5 degrees of freedom.
    few = sample(10.0).recordings["pull"]
    time, stretch = few.inputs["time"][::10], STRETCH[::10]
    stress = np.asarray(few.channels["nominal_stress"].values)[::10]
    made = recording("pull", "uniaxial", time, stretch)
    pull = Recording("pull", "uniaxial", made.inputs, {"nominal_stress": Channel(time, stress, "Pa")}, {})
    found = tj.fit(Sample("s", {"pull": pull}), "neo-hookean", search=ONCE)
    x = stretch - stretch**-2
    s = np.sqrt(np.sum((stress - found.values["energy.mu"] * x) ** 2) / 5)
    by_hand = student.ppf(0.975, 5) * s * np.sqrt(1 + x**2 / np.sum(x**2))
    np.testing.assert_allclose(FitOverlay().prepare(found)[0].band, by_hand, rtol=1e-6)


def test_the_band_from_the_fits_own_jacobian_is_the_same(found):
    problem, values = found.problem, found.values
    own = fitted_std(problem, problem.linearised(values)[1], found.uncertainty)
    again = prediction_std(problem, values, found.uncertainty, ("pull",))
    np.testing.assert_allclose(own["pull"]["nominal_stress"], again["pull"]["nominal_stress"], rtol=1e-9, atol=1e-12)


def test_a_noise_level_a_little_low_is_not_something_missing():
    found = tj.fit(sample(5.0, stated=3.7), "neo-hookean", search=ONCE)
    assert 1.15 < found.chi2_per_dof < 1.5
    assert not beyond_noise(found)
    assert "as well as the noise allows" in sentences.overall(found)
    assert not any("lack" in step for step in sentences.next_steps(found))
    little = tj.fit(sample(5.0, stated=2.5), "neo-hookean", search=ONCE)  # 4 of 1,500 Pa: of no note, as in a judgement
    assert not beyond_noise(little)
    assert "of no note" in sentences.overall(little)
    assert any("is the noise level right?" in w for w in little.warnings)
    scatter = tj.fit(sample(60.0, stated=25.0), "neo-hookean", search=ONCE)  # of 60 independent samples
    assert not beyond_noise(scatter)
    assert "check the noise level" in sentences.overall(scatter)
    assert any("what is left scatters" in w for w in scatter.warnings)
    assert not any("lack" in step for step in sentences.next_steps(scatter))
    worse = sample(25.0)
    channel = worse.recordings["pull"].channels["nominal_stress"]
    channel.values[:] += 80 * np.sin(np.arange(60.0) / 4)  # as much again, and no scatter
    worse = tj.fit(worse, "neo-hookean", search=ONCE)
    assert "something is missing" in sentences.overall(worse)
    assert any("lacks" in step for step in sentences.next_steps(worse))
    assert any("exceeds the noise" in w for w in worse.warnings)


def test_gross_misfit_and_bounds_are_said_first():
    found = tj.fit(sample(5.0, stated=0.5), "neo-hookean", search=ONCE)
    assert any("times the noise" in s for s in suspect(found))
    held = tj.fit(
        sample(10.0),
        "neo-hookean",
        search=ONCE,
        unknowns=tj.Unknowns(bounds={"energy.mu": (100.0, 2000.0)}),
    )
    assert any("upper bound" in s for s in suspect(held))


def test_what_is_not_known_is_said_in_words():
    declared = SimpleNamespace(unit="Pa", typical=1000.0, meaning="")
    fit = SimpleNamespace(
        problem=SimpleNamespace(
            predictor=SimpleNamespace(model=SimpleNamespace(parameters={p: declared for p in "abc"})),
            bound=lambda path: (0.0, np.inf),
        ),
        free=("a", "b", "c"),
        values={"a": 0.4, "b": 3456.7, "c": 2100.0},
        std={"a": 7.4e10, "b": 12.0, "c": 900.0},
        at_bound={},
        intervals={"a": (0.0, 1e11), "b": (3456.7 - 23.52, 3456.7 + 23.52), "c": (300.0, 3900.0)},
    )
    rows = {r["path"]: r for r in sentences.table(fit)}
    assert {r["unit"] for r in rows.values()} == {"kPa"}
    assert rows["a"]["value"] == "0.0004 (not identified)"
    assert rows["a"]["interval"] == ""
    assert rows["b"]["value"] == "3.457 ± 0.012"
    assert rows["b"]["interval"] == "3.433 to 3.48"
    assert rows["c"]["value"] == "2.100 ± 0.90"


@pytest.mark.parametrize("value", [3.2101, 0.0452, 812.34, 5.1e-6])
def test_four_digits_stay_whatever_the_error(value):
    for std in (0.1 * value, 0.5 * value, 3 * value):
        shown = float(with_std(value, std).split(" ±")[0])
        assert shown == pytest.approx(value, rel=5e-4 if std < value else 0.06)


def test_curves_and_table_are_written(found, tmp_path):
    rows = list(csv.DictReader(write_curves(found, tmp_path / "curves.csv").read_text().splitlines()))
    assert len(rows) == 60
    assert float(rows[30]["stretch (1)"]) == pytest.approx(STRETCH[30])
    assert float(rows[30]["model (Pa)"]) == pytest.approx(found.values["energy.mu"] * (STRETCH[30] - STRETCH[30] ** -2))
    half = FitOverlay().prepare(found)[0].band
    assert float(rows[30]["half-width of the 95 % band (Pa)"]) == pytest.approx(half[30])
    assert "effects off (Pa)" not in rows[0]  # there is no effect
    latex = write_latex(found, tmp_path / "t.tex").read_text()
    assert latex.startswith(r"\begin{tabular}")
    assert "energy.mu & " in latex


def test_a_question_ends_in_one_mark():
    wide = sample(10.0).recordings["pull"]
    stretch = np.linspace(1.0, 7.0, 60)
    made = recording("pull", "uniaxial", np.arange(60.0), stretch)
    channel = Channel(
        np.arange(60.0), 3000.0 * (stretch - stretch**-2), "Pa", wide.channels["nominal_stress"].noise_std
    )
    pull = Recording("pull", "uniaxial", made.inputs, {"nominal_stress": channel}, {})
    (said,) = [w for w in tj.fit(Sample("s", {"pull": pull}), "neo-hookean", search=ONCE).warnings if "Look at" in w]
    assert said.endswith("is the height wrong?")


def test_effects_off_is_the_energy_alone():
    time = np.linspace(0, 30, 60)
    stretch = 1 + 0.3 * ramp(time, (0, 0), (2, 1), (30, 1))
    stress = 2000 * (stretch - stretch**-2) * (1 - 0.4 * (1 - np.exp(-np.maximum(time - 1, 0) / 4)))
    made = recording("hold", "uniaxial", time, stretch)
    channel = Channel(time, stress, "Pa", 20.0)
    data = Sample("s", {"hold": Recording("hold", "uniaxial", made.inputs, {"nominal_stress": channel}, {})})
    found = tj.fit(data, "neo-hookean", effects=["viscoelasticity"], search=ONCE)
    bare = FitOverlay().prepare(found)[0].bare
    np.testing.assert_allclose(bare, found.values["energy.mu"] * (stretch - stretch**-2), rtol=1e-9, atol=1e-9)


def test_numerical_errors_are_told_as_shares_of_the_values():
    declared = {p: SimpleNamespace(typical=1000.0) for p in ("energy.mu", "volumetric.K")}
    problem = SimpleNamespace(
        free=tuple(declared), predictor=SimpleNamespace(model=SimpleNamespace(parameters=declared))
    )
    values, shifts = {"energy.mu": 1250.0, "volumetric.K": 8000.0}, {"mesh": {"energy.mu": 25.0, "volumetric.K": 800.0}}
    told = numerical_sentence(problem, values, shifts, SimpleNamespace(std=np.array([12.5, 2400.0])))
    assert told.endswith("of the values: mu 2 % (noise 1 %), K 10 % (noise 30 %).")
