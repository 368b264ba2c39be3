"""Plausibility at the door: each slip is named, sound recordings pass without a word."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tissuejax.errors import InputError
from tissuejax.recordings.plausible import refuse_gaps, refuse_unusable, slips
from tissuejax.recordings.recording import NO_TIME, Channel, Recording, Sample

N = 200


def recording(stretch=None, stress=None, time=None, noise=20.0):
    """A pull to 1.3 with white noise, or what is given instead."""
    rng = np.random.default_rng(3)
    time = np.linspace(0, 20, N) if time is None else time
    stretch = np.linspace(1, 1.3, len(time)) if stretch is None else stretch
    if stress is None:
        stress = 4000 * (stretch - stretch**-2) + rng.normal(0, 20, len(time))
    channel = Channel(time, np.asarray(stress, float), "Pa", noise)
    return Recording("r", "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": channel})


def sample(**recordings):
    return Sample("s", recordings)


def said(**changes):
    return " ".join(slips(sample(r=recording(**changes))))


STRETCH = np.linspace(1, 1.3, N)
STRESS = 4000 * (STRETCH - STRETCH**-2) + np.random.default_rng(4).normal(0, 20, N)
SLIPS = {
    "mm as m": ({"stretch": 1 + 1000 * (STRETCH - 1), "stress": STRESS}, "millimetres may have been read as metres"),
    "um as mm": ({"stretch": 1 + 1e-3 * (STRETCH - 1), "stress": STRESS}, "stays within"),
    "too stiff": ({"stress": 1e6 * STRESS}, "above 1e+08 Pa"),
    "too soft": ({"stress": 1e-5 * STRESS}, "no cell resolves"),
    "turned round": ({"stress": -STRESS}, "a sign is turned round"),
    "dead": ({"stress": np.zeros(N)}, "zero throughout"),
    "stuck": ({"stress": np.full(N, 500.0)}, "stuck sensor"),
    "saturated": ({"stress": np.minimum(STRESS, 2000)}, "the sensor was at its end"),
    "few": ({"time": np.arange(6.0)}, "6 samples only"),
    "gap": ({"time": np.concatenate([np.linspace(0, 10, N // 2), np.linspace(60, 70, N // 2)])}, "a gap of 50 s"),
    "filtered": (
        {
            "stress": 4000 * (STRETCH - STRETCH**-2)
            + np.convolve(np.random.default_rng(5).normal(0, 60, N + 8), np.ones(9) / 9, "valid"),
            "noise": None,
        },
        "smoothed or filtered",
    ),
    "history": ({"stress": STRESS + 800}, "not at zero"),
    "noise alone": ({"stress": np.random.default_rng(4).normal(0, 20, N)}, "does not follow the deformation"),
    "stuck on the way": ({"stress": np.where(np.arange(N) // 40 == 2, STRESS[80], STRESS)}, "the sensor was stuck"),
    "cable off": ({"stress": np.where(np.arange(N) < 150, STRESS, 0.0)}, "a cable off"),
    "long at its end": ({"stress": np.minimum(STRESS, 800)}, "the sensor was at its end"),
    "coarse": ({"stress": 500 * np.round(STRESS / 500)}, "comes in steps of 500 Pa"),
    "spike": ({"stress": STRESS + 9000 * (np.arange(N) == 77)}, "one sample stands far beyond both neighbours"),
    "uneven": ({"time": np.cumsum(np.where(np.arange(N) < 100, 0.03, 0.5))}, "sampled unevenly, 0.03 to 0.5 s apart"),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_each_slip_is_named(slip):
    changes, words = SLIPS[slip]
    assert words in said(**changes)


@pytest.mark.parametrize("width", [1.0, 2.0, 3.0, 4.0])
def test_noise_behind_a_filter_of_any_usual_width_is_seen(width):
    """Beyond four samples and 400 of them, what is left of the noise is as smooth as the curve."""
    from scipy.ndimage import gaussian_filter1d

    stretch = np.linspace(1, 1.3, 400)
    noise = gaussian_filter1d(np.random.default_rng(7).normal(0, 25, 400), width)
    stress = 4000 * (stretch - stretch**-2) + noise
    assert "smoothed or filtered" in said(stretch=stretch, stress=stress, time=np.linspace(0, 20, 400), noise=None)


def test_a_recording_cut_out_of_a_longer_one_is_told_that_its_history_is_missing():
    late = recording(stretch=np.linspace(1.1, 1.3, N))
    words = "r: starts at stretch 1.1, not at rest (1): what was done before the recording no model knows of"
    assert any(said.startswith(words) for said in slips(sample(r=late)))
    pressed, sheared = recording(stretch=np.linspace(0.93, 0.5, N)), recording()
    assert "starts at stretch 0.93, not" in " ".join(slips(sample(r=pressed)))
    sheared = replace(sheared, inputs={"time": sheared.inputs["time"], "shear": np.linspace(-0.2, 0.5, N)})
    assert "starts at shear -0.2, not at rest (0)" in " ".join(slips(sample(r=sheared)))
    both = replace(late, inputs={"stretch": np.column_stack([np.linspace(1, 1.3, N), np.linspace(1.04, 1.2, N)])})
    assert "starts at stretch 1.04, not" in " ".join(slips(sample(r=both)))  # the axis that is further from rest
    both = replace(late, inputs={"stretch": np.column_stack([np.linspace(1.04, 2, N), np.linspace(1.02, 1.1, N)])})
    assert "starts at stretch 1.02, not" in " ".join(slips(sample(r=both)))  # each by how far it is driven


@pytest.mark.parametrize(("first", "last"), [(1.0, 1.3), (1.014, 1.3), (0.988, 0.75), (1.0009, 1.01)])
def test_a_first_reading_near_rest_is_no_missing_history(first, last):
    assert "not at rest" not in said(stretch=np.linspace(first, last, N))


def test_rows_without_times_have_no_history_that_could_be_missing():
    rows = Sample("s", {"r": recording(stretch=np.linspace(1.1, 1.3, N))}, notes=NO_TIME)
    assert "not at rest" not in " ".join(slips(rows))


def test_where_the_noise_was_recorded_a_filter_asks_for_nothing():
    stretch = np.linspace(1, 1.3, 400)
    noise = np.convolve(np.random.default_rng(7).normal(0, 60, 408), np.ones(9) / 9, "valid")
    stress = 4000 * (stretch - stretch**-2) + noise
    made = recording(stretch=stretch, stress=stress, time=np.linspace(0, 20, 400), noise=None)
    assert "smoothed or filtered" in " ".join(slips(sample(r=made)))
    known = {"nominal_stress": replace(made.channels["nominal_stress"], noise_std=20.0)}
    assert "smoothed or filtered" not in " ".join(slips(sample(r=replace(made, channels=known))))


def test_creep_is_no_sensor_at_its_end():
    """The stress is set; the specimen goes on, ever slower. A sensor at its end leaves a ramp as fast as it was."""
    time = np.linspace(0, 60, N)
    creep = 1.1 + 0.05 * (1 - np.exp(-time / 10))
    ramp = np.minimum(time / 5, 1)
    words = said(stretch=1 + (creep - 1) * ramp, stress=500 * ramp, time=time)
    assert "a creep test" in words
    assert "at its end" not in words
    refuse_unusable(sample(r=recording(creep, np.full(N, 500.0), time)), ("r",))  # a hold alone can be fitted


@pytest.mark.parametrize("seed", range(5))
def test_sound_recordings_pass_without_a_word(seed):
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 30, 600)
    stretch = 1 + 0.15 * (1 - np.cos(2 * np.pi * time / 10)) * (1 if seed % 2 else -1)
    stress = 4000 * (stretch - stretch**-2) + rng.normal(0, 15, 600)
    assert slips(sample(r=recording(stretch, stress, time))) == []


def test_white_noise_is_seldom_called_filtered():
    called = 0
    for seed in range(200):
        stress = 4000 * (STRETCH - STRETCH**-2) + np.random.default_rng(seed).normal(0, 20, N)
        called += any("filtered" in s for s in slips(sample(r=recording(STRETCH, stress))))
    assert called <= 4  # 2 %


def test_the_demonstration_passes():
    from tissuejax.recordings.files import read

    for name in ("elastic", "relaxing"):
        assert slips(read(Path(__file__).parents[2] / "data" / "demo" / f"{name}.h5")) == []


UNUSABLE = {
    "absurd": ({"r": recording(stress=1e300 * STRESS)}, "nothing that is measured exceeds"),
    "dead": ({"r": recording(stress=np.zeros(N))}, "zero throughout"),
    "nothing done": ({"r": recording(stretch=np.ones(N), stress=np.full(N, 5.0))}, "nothing to fit"),
    "noise alone": ({"r": recording(stress=np.random.default_rng(4).normal(0, 20, N))}, "does not follow"),
    "constant": ({"r": recording(stress=np.full(N, 1025.0))}, "1025 Pa throughout while the specimen moves"),
    "two rows": ({"r": recording(time=np.arange(2.0))}, "2 samples"),
    "noise zero": ({"a": recording(noise=0.0)}, "above zero"),
    "noise zero beside noise": ({"a": recording(), "b": recording(noise=0.0)}, "recording b: noise_std"),
}


@pytest.mark.parametrize("case", UNUSABLE)
def test_what_can_not_be_fitted_is_refused(case):
    recordings, words = UNUSABLE[case]
    with pytest.raises(InputError, match=words):
        refuse_unusable(sample(**recordings), recordings)


def test_lost_samples_hide_nothing_else_and_are_refused_where_all_are_needed():
    lost = np.where(np.arange(N) == 7, np.nan, np.minimum(STRESS, 0.8 * np.max(STRESS)))
    assert "sensor was at its end" in said(stretch=STRETCH, stress=lost)
    with pytest.raises(InputError, match=f"1 of {N} samples of nominal_stress are not finite"):
        refuse_gaps(sample(r=recording(STRETCH, lost)), ("r",))


def test_a_dead_sensor_stops_fit_and_diagnosis(tmp_path, capsys):
    from tissuejax.cli import main

    rows = "".join(f"{k},{1 + 0.001 * k},0\n" for k in range(30))
    (tmp_path / "t.csv").write_text("time (s),stretch,stress (kPa)\n" + rows)
    assert main(["import", str(tmp_path / "t.csv")]) == 0
    for verb in ("fit", "diagnose"):
        assert main([verb, str(tmp_path / "t.toml"), "--energy", "neo-hookean", "--out", str(tmp_path / "o")]) == 2
        assert "zero throughout" in capsys.readouterr().err


def test_an_unknown_effect_is_refused_before_anything_runs(capsys):
    from tissuejax.cli import main

    relaxing = str(Path(__file__).parents[2] / "data/demo/relaxing.h5")
    assert main(["diagnose", relaxing, "--energy", "neo-hookean", "--effect", "viscoelastic"]) == 2
    assert "Did you mean 'viscoelasticity'" in capsys.readouterr().err
