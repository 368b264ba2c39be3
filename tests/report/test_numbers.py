"""Files beside a page: the numbers of its figures with units in the header, its tables as LaTeX, figures for papers."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest

import tissuejax as tj
from tests.specimens import recording
from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.fitting.comparison import compare
from tissuejax.fitting.profile import profile
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.report.cohort_page import write_cohort
from tissuejax.report.comparison_page import write_comparison
from tissuejax.report.diagnosis_curves import DiagnosisCurves
from tissuejax.report.diagnosis_page import write_diagnosis
from tissuejax.report.numbers import write_series, write_tabular
from tissuejax.report.page import write_figures
from tissuejax.report.posterior_pairs import Drawn, PosteriorPairs, write_latex
from tissuejax.report.profiles import Profiles, write_profiles

ONCE = tj.Search(multistart=1)
STRETCH = np.linspace(1.0, 1.4, 60)


def sample():
    """Mooney-Rivlin's tension with noise of 5 Pa, twice."""
    pulls = {}
    for k, name in enumerate(("pull", "again")):
        made = recording(name, "uniaxial", np.arange(60.0), STRETCH)
        noise = np.random.default_rng(k).normal(size=60)
        stress = 2 * (STRETCH - STRETCH**-2) * (300 + 500 / STRETCH) + 5 * noise
        channel = Channel(np.arange(60.0), stress, "Pa", 5.0)
        pulls[name] = Recording(name, "uniaxial", made.inputs, {"nominal_stress": channel}, {})
    return Sample("s", pulls)


@pytest.fixture(scope="module")
def fits():
    energies = ("neo-hookean", "mooney-rivlin")
    return {name: tj.fit(sample(), name, holdout=["again"], search=ONCE) for name in energies}


def table(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def printed(folder: Path) -> set[str]:
    return {p.name for p in (folder / "print").iterdir()}


def test_series_of_other_units_have_columns_of_their_own(tmp_path):
    one = ({"of": "a"}, {"time (s)": np.array([0.0, 1.0]), "force (N)": np.array([2.0, np.nan])})
    two = ({"of": "b"}, {"time (s)": np.array([0.5]), "way (m)": np.array([0.1]), "band (m)": None})
    text = write_series(tmp_path / "s.csv", [one, two]).read_text().splitlines()
    assert text == ["of,time (s),force (N),way (m),band (m)", "a,0,2,,", "a,1,,,", "b,0.5,,0.1,"]


def test_a_table_for_latex(tmp_path):
    text = write_tabular(tmp_path / "t.tex", {"a_1": "l", "95 %": "r"}, [("x & y", "1 ± 2")]).read_text()
    lines = [r"\begin{tabular}{lr}", r"a\_1 & 95 \% \\ \hline", r"x \& y & 1 $\pm$ 2 \\", r"\end{tabular}", ""]
    assert text == "\n".join(lines)


def test_a_comparison_in_numbers(fits, tmp_path):
    found = compare({name: fit.record() for name, fit in fits.items()}, fits=fits)
    files = write_comparison(found, tmp_path)
    first, second = table(files["table"])
    assert first["model"] == "mooney-rivlin"
    assert float(first["AIC - least AIC"]) == 0
    best, other = found.rows
    assert float(second["AIC - least AIC"]) == pytest.approx(other.aic - best.aic)
    assert float(second["RMSE held out (Pa)"]) == pytest.approx(other.held["Pa"])
    assert all(re.fullmatch(r"[-+.\de]+", v) for row in (first, second) for k, v in row.items() if k != "model")
    rows = table(files["data"])
    assert len(rows) == 120
    assert set(rows[0]) == {
        "recording", "channel", "held out", "time (s)", "stretch (1)", "measured (Pa)", "neo-hookean (Pa)",
        "mooney-rivlin (Pa)",
    }  # fmt: skip
    told = {float(r["stretch (1)"]): float(r["neo-hookean (Pa)"]) for r in rows if r["recording"] == "again"}
    mu = fits["neo-hookean"].values["energy.mu"]
    np.testing.assert_allclose([told[s] for s in told], [mu * (s - s**-2) for s in told], rtol=1e-6, atol=1e-6)
    assert r"mooney-rivlin & 2 & 0.0" in files["latex"].read_text()
    assert printed(tmp_path) == {f"{n}.{kind}" for n in ("curves", "support") for kind in ("svg", "pdf")}


def test_profiles_and_posteriors_in_numbers(fits, tmp_path):
    fit = fits["neo-hookean"]
    drawn = Profiles(fit, (profile(fit, "energy.mu", points=3),))
    assert {"profiles", "profiles.svg", "profiles.pdf"} == set(write_figures(drawn, tmp_path))
    rows = table(write_profiles(drawn, tmp_path / "profiles.csv"))
    assert [float(r["held at (Pa)"]) for r in rows] == pytest.approx(drawn.profiles[0].values)
    assert [float(r["rise of chi-square"]) for r in rows] == pytest.approx(drawn.profiles[0].rise, abs=1e-6)


def test_a_posterior_names_its_curves_and_has_a_table(fits, tmp_path):
    pytest.importorskip("blackjax")
    from tissuejax.fitting.posterior import laplace, target_of

    fit = fits["mooney-rivlin"]
    drawn = Drawn(fit, laplace(target_of(fit), np.array([fit.values[p] for p in fit.free]), 2000))
    plot = PosteriorPairs()
    figure = plot.draw(plot.prepare(drawn))
    assert {t.get_text() for t in figure.legends[0].get_texts()} == {"draws", "estimate and standard error"}
    text = write_latex(drawn, tmp_path / "parameters.tex").read_text()
    assert "energy.C10" in text
    assert " to " in text


def test_a_diagnosis_in_numbers(tmp_path):
    found = diagnose(sample(), "neo-hookean", holdout=["again"], effects=["energy-form"])
    files = write_diagnosis(found, tmp_path)
    rows = table(files["curves"])
    shown = DiagnosisCurves().prepare(found)
    assert len(rows) == sum(len(c.time) for c in shown)
    assert {r["recording"] for r in rows} == {"pull", "again"}
    last = shown[-1]
    assert float(rows[-1]["half-width of the 95 % band (Pa)"]) == pytest.approx(last.half[-1])
    assert float(rows[-1]["base model (Pa)"]) == pytest.approx(last.base[-1])
    if last.improved is not None:
        assert float(rows[-1]["with effects (Pa)"]) == pytest.approx(last.improved[-1])
    assert "energy.mu & " in files["table"].read_text()
    assert {"measured.svg", "measured.pdf"} <= printed(tmp_path)


def test_the_page_of_a_campaign_is_printable(tmp_path):
    rows = [{"sample": f"s{k}", "energy.mu (Pa)": 1000.0 + k} for k in range(5)]
    counts = {"cases": 5, "done": 5, "failed": 0, "missing": 0, "suspect": 0, "suspect_kinds": {}, "usable": 5}
    write_cohort(rows, counts, tmp_path)
    assert printed(tmp_path) == {"cohort.svg", "cohort.pdf"}
