"""Cycles, phases, preload and toe: the rows kept are those that were made for it; the picture holds the same rows."""

import numpy as np
import pytest

from tissuejax.errors import InputError
from tissuejax.recordings.files import read
from tissuejax.recordings.selection import Selection, chosen, selection_from, turns
from tissuejax.recordings.table import selections

T = np.arange(0, 30, 0.05)
# Four cycles of 5 s to 2 mm, then a ramp to 5 mm that is held.
U = np.where(T < 20, 1 - np.cos(2 * np.pi * T / 5), np.clip(T - 20, 0, 5))
F = 0.1 * U


def write(folder, more, u=U, f=F):
    rows = "".join(f"{t:.3f},{a:.5f},{b:.6f}\n" for t, a, b in zip(T, u, f))
    (folder / "t.csv").write_text("t,u,F\n" + rows)
    (folder / "t.toml").write_text(
        f'file = "t.csv"\nexperiment = "tension"\n{more}\n[columns]\ntime = {{ column = "t", unit = "s" }}\n'
        'displacement = { column = "u", unit = "mm" }\nload = { column = "F", unit = "N" }\n'
        '[specimen]\nlength = "25mm"\narea = "10 mm^2"\n'
    )
    return folder / "t.toml"


CUTS = {
    # what is asked for -> first and last time kept
    'cycles = "last"': (20.0, 29.95),
    'cycles = "first"': (0.0, 5.0),
    "cycles = 3": (10.0, 15.0),
    'cycles = "2-3"': (5.0, 15.0),
    'cycles = "after 4"': (20.0, 29.95),
    'cycles = 2\nphase = "loading"': (5.0, 7.5),
    'cycles = 2\nphase = "unloading"': (7.5, 10.0),
    'cycles = "last"\nphase = "loading"': (20.0, 25.0),
    'upto = "peak"': (0.0, 25.0),
}


@pytest.mark.parametrize("more", CUTS)
def test_rows_kept(more, tmp_path):
    side = write(tmp_path, more)
    time = read(side).recordings["r1"].inputs["time"]
    # Near the peak a half per cent of the way counts as arrived: 0.12 s of the cosine.
    np.testing.assert_allclose([time[0], time[-1]], CUTS[more], atol=0.13)
    (shown,) = selections(side, "sample")
    assert shown.kept.sum() == len(time)
    np.testing.assert_allclose(shown.time[shown.kept], time)


def test_noise_does_not_make_cycles():
    noisy = U + np.random.default_rng(0).normal(0, 0.03, len(U))
    assert len(turns(noisy)) == len(turns(U))
    mask, _ = chosen(Selection(cycles=(2, 2)), noisy, F, "here")
    assert T[mask][0] == pytest.approx(5, abs=0.4)
    assert T[mask][-1] == pytest.approx(10, abs=0.4)


def test_deformation_counts_from_the_preload(tmp_path):
    r = read(write(tmp_path, 'cycles = "last"\npreload = "0.1 N"')).recordings["r1"]
    assert r.inputs["time"][0] == pytest.approx(21.0, abs=0.06)  # 0.1 N at 1 mm
    assert r.inputs["stretch"][-1] == pytest.approx(1 + (5 - 1) / 25)


def test_slack_is_taken_off_by_the_line_of_the_loads(tmp_path):
    slack = np.clip(U - 1.5, 0, None) * 0.1
    r = read(write(tmp_path, 'cycles = "last"\ntoe = ["0.05 N", "0.3 N"]', f=slack)).recordings["r1"]
    assert r.inputs["stretch"][-1] == pytest.approx(1 + (5 - 1.5) / 25, rel=1e-4)


def test_up_to_the_first_drop(tmp_path):
    broken = np.where(T > 23, 0.2 * F, F)
    time = read(write(tmp_path, 'cycles = "last"\nupto = "first drop"', f=broken)).recordings["r1"].inputs["time"]
    assert time[-1] == pytest.approx(2.5, abs=0.1)  # the first unloading is a fall of the load too


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("cycles = 9", "cycle 9 wanted, found 5 cycle"),
        ('cycles = "after 6"', "cycle 7 and those after it wanted"),
        ('cycles = "4-8"', "cycles 4 to 8 wanted"),
        ('cycles = "some"', "expected 'last'"),
        ('phase = "up"', "'loading' or 'unloading'"),
        ('preload = "9 N"', r"9 N is never reached, the largest load is [\d.]+ N"),
        ('preload = "9 mm"', "dimension"),
        ('toe = "5%"', "two loads"),
        ("direction = [0, 0, 0]", "three numbers"),
    ],
)
def test_refusals(more, words, tmp_path):
    with pytest.raises(InputError, match=words):
        read(write(tmp_path, more))


def test_a_direction_is_kept_and_natural_words_are_read(tmp_path):
    r = read(write(tmp_path, "direction = [0, 3, 4]")).recordings["r1"]
    np.testing.assert_allclose(r.attributes["direction"], [0, 0.6, 0.8])
    assert not selection_from({})


def test_a_picture_is_drawn(tmp_path):
    from tissuejax.cli import main

    assert main(["inspect", str(write(tmp_path, 'cycles = "last"')), "--out", str(tmp_path / "look")]) == 0
    assert (tmp_path / "look" / "kept.png").stat().st_size > 5000
