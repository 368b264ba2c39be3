"""Comparisons against the textbook's own formulas, and the refusals."""

import json
import math

import numpy as np
import pytest

from tests.specimens import every_kind
from tissuejax.cli import main
from tissuejax.errors import InputError
from tissuejax.fitting.comparison import compare
from tissuejax.recordings.hdf5_writing import write
from tissuejax.recordings.recording import Channel, Recording, Sample


def record(name, free, rmse, n=100, std=1.0, estimated=False, data="d", held=None):
    score = {"rmse": rmse, "n": n, "unit": "Pa"}
    return {
        "sample": "s",
        "energy": {"name": name},
        "effects": [],
        "status": "converged",
        "data": data,
        "parameters": {f"energy.{i}": {"free": True, "at_bound": None} for i in range(free)},
        "noise": {"r/x": {"std": std, "estimated": estimated}},
        "channels": {"r/x": score},
        "holdout": {} if held is None else {"h/x": score | {"rmse": held}},
        "chi2_per_dof": n * (rmse / std) ** 2 / (n - free),
        "not_identified": [],
    }


def test_unknown_noise_gives_the_least_squares_form_of_aic():
    # Burnham and Anderson 2002, sec. 2.2: AIC = n ln(RSS/n) + 2 (k + 1) up to a constant, n ln(2 pi) + n here.
    found = compare({"a": record("a", 2, 3.0, estimated=True), "b": record("b", 4, 2.9, estimated=True)})
    rows = {r.name: r for r in found.rows}
    for name, k, rmse in (("a", 2, 3.0), ("b", 4, 2.9)):
        plain = 100 * math.log(rmse**2) + 100 * (1 + math.log(2 * math.pi))
        assert rows[name].aic == pytest.approx(plain + 2 * (k + 1))
        assert rows[name].bic == pytest.approx(plain + (k + 1) * math.log(100))
        assert rows[name].aicc == pytest.approx(plain + 2 * (k + 1) + 2 * (k + 1) * (k + 2) / (100 - k - 2))
        assert rows[name].chi2_per_dof is None
    difference = 100 * math.log(2.9**2 / 3.0**2) + 4
    assert rows["b"].weight == pytest.approx(1 / (1 + math.exp(0.5 * difference)))


def test_known_noise_gives_chi_square_and_a_shared_misfit_is_divided_out():
    found = compare({"a": record("a", 1, 3.0), "b": record("b", 3, 2.9)})
    a, b = (next(r for r in found.rows if r.name == n) for n in "ab")
    assert a.deviance - b.deviance == pytest.approx(100 * (9 - 2.9**2))
    c = 100 * 2.9**2 / 97  # the least of the two
    assert found.inflation == pytest.approx(c)
    quasi = (a.deviance - b.deviance) / c - 4
    assert b.weight / a.weight == pytest.approx(math.exp(0.5 * quasi))
    assert a.weight + b.weight == pytest.approx(1)


def test_fits_to_different_data_are_refused():
    with pytest.raises(InputError, match="different data"):
        compare({"a": record("a", 1, 3.0), "b": record("b", 1, 3.0, data="other")})
    with pytest.raises(InputError, match="does not say which data"):
        compare({"a": record("a", 1, 3.0, data=None)})


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A tension test of a Mooney-Rivlin solid by its textbook formula, with noise; and one with a sample more."""
    rng, folder = np.random.default_rng(5), tmp_path_factory.mktemp("compare")
    paths = []
    for n in (80, 81):
        stretch = np.linspace(1.0, 1.6, n)
        stress = 2 * (stretch - stretch**-2) * (300 + 500 / stretch) + 4 * rng.normal(size=n)
        time = np.linspace(0, 10, n)
        made = Recording(
            "pull", "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": Channel(time, stress, "Pa", 4.0)}
        )
        paths.append(folder / f"{n}.h5")
        write(Sample(f"s{n}", {"pull": made}), paths[-1])
    return folder, paths


def test_the_law_that_made_the_data_is_supported_and_another_sample_is_refused(files, capsys):
    folder, (one, other) = files
    common = ["--multistart", "1", "--json"]
    code = main(
        [
            "compare",
            str(one),
            "-e",
            "neo-hookean",
            "-e",
            "mooney-rivlin",
            "-e",
            "demiray",
            *common,
            "-o",
            str(folder / "c"),
        ]
    )
    told = json.loads(capsys.readouterr().out)
    assert code == 0
    assert told["rows"][0]["name"] == "mooney-rivlin"
    assert told["rows"][0]["weight"] > 0.99
    assert (folder / "c" / "report.html").stat().st_size > 10000
    for path, energy in ((one, "neo-hookean"), (one, "mooney-rivlin"), (other, "mooney-rivlin")):
        assert main(["fit", str(path), "-e", energy, *common, "-o", str(folder / f"{path.stem}-{energy}")]) in (0, 4)
    capsys.readouterr()
    results = [str(folder / f"{n}" / "result.json") for n in ("80-neo-hookean", "80-mooney-rivlin", "81-mooney-rivlin")]
    assert main(["compare", *results[:2], "--json", "-o", str(folder / "r")]) == 0
    again = {r["name"]: r["deviance"] for r in json.loads(capsys.readouterr().out)["rows"]}
    assert again == pytest.approx({r["name"]: r["deviance"] for r in told["rows"] if r["name"] in again})
    assert main(["compare", results[0], results[2], "-o", str(folder / "r")]) == 2
    assert "different data" in capsys.readouterr().err


def test_a_path_no_model_has_is_refused(tmp_path, capsys):
    write(every_kind(20), tmp_path / "s.h5")
    assert main(["compare", str(tmp_path / "s.h5"), "-e", "demiray", "-e", "gent", "--fix", "energy.Jn=3"]) == 2
    assert "energy.Jm" in capsys.readouterr().err
