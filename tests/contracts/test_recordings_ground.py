"""The ground that recordings stand on: atomic files, progress, units."""

import contextlib
import io
import json
import os

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tissuejax import progress, storage, units
from tissuejax.errors import InputError


class Figure:
    """Stands in for a figure: anything with savefig."""

    def savefig(self, path, **options):
        assert path.suffix == ".png"
        path.write_bytes(b"picture %d" % options["dpi"])


def test_files_of_each_kind(tmp_path):
    storage.write_text(tmp_path / "new" / "a.txt", "µ")
    assert (tmp_path / "new" / "a.txt").read_text("utf-8") == "µ"
    storage.write_npz(tmp_path / "a", {"x": jnp.arange(3)})
    np.testing.assert_array_equal(np.load(tmp_path / "a.npz")["x"], [0, 1, 2])
    storage.write_figure(tmp_path / "a.png", Figure(), dpi=90)
    assert (tmp_path / "a.png").read_bytes() == b"picture 90"
    content = {"a": np.nan, "b": jnp.ones(2), "c": {1: (np.float32(0.5), np.int64(3), True, None)}, "p": tmp_path}
    storage.write_json(tmp_path / "a.json", content)
    assert json.loads((tmp_path / "a.json").read_text()) == {
        "a": None,
        "b": [1, 1],
        "c": {"1": [0.5, 3, True, None]},
        "p": str(tmp_path),
    }
    with pytest.raises(TypeError, match="object"):
        storage.plain(object())


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = storage.write_text(tmp_path / "a.txt", "old")
    with contextlib.suppress(KeyboardInterrupt), storage.replacing(path) as temporary:
        temporary.write_text("half")
        assert temporary.parent == path.parent
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_place_that_cannot_be_written_is_bad_input(tmp_path):
    storage.write_text(tmp_path / "file", "x")
    with pytest.raises(InputError, match="can't be written"):
        storage.write_text(tmp_path / "file" / "a.txt", "x")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="can't be written"):
        storage.write_text(tmp_path / "folder", "x")


def test_progress_counts_and_stays_off_standard_output(capsys):
    screen = io.StringIO()
    for reporter in (progress.Silent(), progress.Bar(screen)):
        with reporter.stage("outer", 2) as outer, reporter.stage("inner") as inner:
            outer.advance(2, note="specimen 7")
            inner.advance()
    assert "2/2" in screen.getvalue()
    assert "specimen 7" in screen.getvalue()
    assert capsys.readouterr().out == ""


CONVERSIONS = [
    (3.2, "kPa", "Pa", 3200.0),
    (1.0, "N/mm^2", "Pa", 1e6),
    (1.0, "N/mm²", "Pa", 1e6),
    (1.0, "mmHg", "Pa", 133.322387415),
    (2.0, "gf", "N", 0.0196133),
    (5.0, "%", "1", 0.05),
    (180.0, "deg", "rad", np.pi),
    (7.0, "µm", "m", 7e-6),
    (1.06, "g/cm^3", "kg/m^3", 1060.0),
    (2.0, "min", "s", 120.0),
    (4.0, "", "1", 4.0),
]


@pytest.mark.parametrize(("value", "unit", "si", "expected"), CONVERSIONS)
def test_units_by_their_definitions(value, unit, si, expected):
    assert units.to_si(value, unit, si) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "si", "words"),
    [
        ("mm", "Pa", "[length]"),
        ("kPA", "Pa", "'kPa'"),
        ("foo(", "m", "foo("),
        ("1", "Pa", "dimensionless"),
        ("", "m", ""),
    ],
)
def test_wrong_units_are_refused(unit, si, words):
    with pytest.raises(InputError) as refused:
        units.to_si(1.0, unit, si)
    assert words in str(refused.value)


@given(st.floats(-1e9, 1e9), st.sampled_from(["m", "mm", "um", "km"]))
def test_quantities_read_back(value, unit):
    expected = value * {"m": 1, "mm": 1e-3, "um": 1e-6, "km": 1e3}[unit]
    assert units.quantity(f"{value!r} {unit}", "m") == pytest.approx(expected, rel=1e-12, abs=1e-300)


@pytest.mark.parametrize("text", ["30", "mm", "x mm", None, 3.0, "30 kPa", "1 2 m"])
def test_quantities_need_number_and_unit(text):
    with pytest.raises(InputError, match="height|unit"):
        units.quantity(text, "m", "height")


def test_a_ratio_needs_no_unit():
    assert units.quantity(0.25, "1") == 0.25
    assert units.quantity("25%", "1") == units.quantity("25 %", "1") == 0.25
