"""Noise of a sample's channels against levels of its columns, and each remark word for word."""

import math

import numpy as np
import pytest

from tissuejax.estimation.level import Level, Response, levels
from tissuejax.estimation.sigma import QUIETEST, caution, sigmas
from tissuejax.recordings.recording import Channel, Recording, Sample

T = np.arange(40.0)
TWO = np.stack([1 + 0.01 * T, 1 + 0.02 * T], 1)


def recording(name: str, values, noise=None, channel="nominal_stress", **inputs) -> Recording:
    return Recording(name, "", {"time": T, **inputs}, {channel: Channel(T, np.asarray(values), "Pa", noise)})


def sample(*recordings: Recording) -> Sample:
    return Sample("s", {r.name: r for r in recordings})


def cubed(size: float) -> np.ndarray:
    """Third differences of 6 of these: a short series of t^3 has noise of 6 / sqrt(20) / 0.6745."""
    return size * T**3


OF_CUBE = 6 / math.sqrt(20) / 0.6745


def test_columns_count_by_their_mean_square_and_are_at_least_a_thousandth_of_the_whole(rng):
    small = 1e3 * rng.normal(size=(40, 2))
    of = sample(recording("r", small, stretch=TWO), recording("loud", cubed(1.0), stretch=TWO[:, 0]))
    found, said = sigmas(of, ("loud", "r"))
    own = [x.std for x in levels([Response(T, TWO[:, i], small[:, i]) for i in (0, 1)])]
    assert own[0] != pytest.approx(own[1], rel=1e-3)
    assert list(found) == ["loud", "r"]
    assert found["r"] == pytest.approx(math.sqrt((own[0] ** 2 + own[1] ** 2) / 2), rel=1e-12)
    assert QUIETEST == 1e-3
    assert found["loud"] == pytest.approx(1e-3 * math.sqrt(np.mean(T**6)), rel=1e-12)
    assert found["loud"] > OF_CUBE
    stated = f"loud {found['loud']:.3g} Pa, r {found['r']:.3g} Pa"
    assert said[0] == f"noise was not recorded and is estimated from the recordings themselves: {stated}"
    assert said[1].startswith("loud, r: too few samples")
    assert len(said) == 2


def test_what_was_recorded_is_kept_and_a_noise_of_nothing_was_not_recorded():
    of = sample(
        recording("a", cubed(1.0), 3.0, stretch=TWO[:, 0]),
        recording("b", cubed(1e-3) + 1.0, 0.0, stretch=TWO[:, 0]),
        recording("c", cubed(1.0), 5.0, stretch=TWO[:, 0]),
    )
    assert sigmas(of, ("c", "a")) == ({"c": 5.0, "a": 3.0}, [])
    found, said = sigmas(of, ("c", "b", "a"))
    assert list(found) == ["c", "b", "a"]
    assert (found["c"], found["a"]) == (5.0, 3.0)
    assert found["b"] == pytest.approx(1e-3 * math.sqrt(np.mean((1 + 1e-3 * T**3) ** 2)), rel=1e-12)
    assert said[0].endswith(f": b {found['b']:.3g} Pa")


def test_lost_samples_are_left_out_and_nothing_at_all_counts_as_of_one():
    y = 1e4 * np.sin(T**2)
    lost = np.where(np.isin(T, [3, 20]), np.nan, y)
    of = sample(recording("lost", lost, stretch=TWO[:, 0]), recording("nothing", 0 * T, stretch=TWO[:, 0]))
    kept = np.isfinite(lost)
    (own,) = levels([Response(T[kept], TWO[kept, 0], y[kept])])
    found, _ = sigmas(of, ("lost", "nothing"))
    assert found["lost"] == pytest.approx(own.std, rel=1e-12)
    assert found["nothing"] == pytest.approx(1e-3, rel=1e-12)


@pytest.mark.parametrize("inputs", [
    {"shear": np.linspace(0, 1, 80)},
    {"shear": np.linspace(0, 1, 80), "stretch": np.ones(80)},
    {"stretch": np.linspace(1, 2, 80)},
])  # fmt: skip
def test_the_response_is_to_shear_where_there_is_one_and_to_stretch_otherwise(rng, inputs):
    """Noise beside a large response to the drive: without the drive it could not be told from it."""
    time = np.arange(80.0)
    drive = next(iter(inputs.values()))
    response = np.exp(3 * (drive - drive[0])) + np.sin(6 * drive)
    y = np.stack([100 * drive + rng.normal(size=80), response], 1)
    of = Sample("s", {"r": Recording("r", "", {"time": time, **inputs}, {"force": Channel(time, y, "N")})})
    found, said = sigmas(of, ("r",), "force")
    own = levels([Response(time, drive, y[:, i]) for i in (0, 1)])
    assert found["r"] == pytest.approx(math.sqrt(np.mean([x.std**2 for x in own])), rel=1e-12)
    assert f"r {found['r']:.3g} N" in said[0]


def test_each_column_has_the_drive_of_its_axis(rng):
    time = np.arange(80.0)
    drives = np.stack([np.minimum(time, 30.0), np.sin(time / 8)], 1)
    y = np.exp(drives / 20) * 40 + 5 * rng.normal(size=(80, 2))
    three = np.concatenate([y, np.cosh(drives[:, 1:])], axis=1)
    of = Sample("s", {"r": Recording("r", "", {"stretch": drives}, {"nominal_stress": Channel(time, three, "Pa")})})
    own = levels([Response(time, drives[:, min(i, 1)], three[:, i]) for i in range(3)])
    crossed = levels([Response(time, drives[:, 1 - min(i, 1)], three[:, i]) for i in range(3)])
    said = math.sqrt(np.mean([x.std**2 for x in own]))
    assert said != pytest.approx(math.sqrt(np.mean([x.std**2 for x in crossed])), rel=1e-3)
    assert sigmas(of, ("r",))[0]["r"] == pytest.approx(said, rel=1e-12)


FEW = (
    "too few samples to tell slow noise from the response; noise is taken as white, and if it was filtered or "
    "correlated it is larger than said, and misfit is overstated: record a rest, or give noise_std"
)
STEPS = "noise is at least step / sqrt(12)"
SMOOTH = (
    "noise behind a filter would look like it, so its level can't be known from these recordings and a verdict that "
    "something is missing rests on its not being noise; record a rest, or give noise_std"
)


@pytest.mark.parametrize(("parts", "said"), [
    ({"a": [Level(1.0)]}, []),
    ({}, []),
    ({"a": [Level(1.0), Level(1.0, short=True)], "b": [Level(1.0)], "c": [Level(1.0, short=True)]}, [f"a, c: {FEW}"]),
    (
        {"a": [Level(1.0, resolution=0.5), Level(1.0, resolution=2.0)], "b": [Level(1.0)]},
        [f"values were recorded in steps (a 2 kN); {STEPS}"],
    ),
    (
        {"a": [Level(1.0, resolution=0.012345)], "b": [Level(1.0, resolution=3.0)]},
        [f"values were recorded in steps (a 0.0123 kN, b 3 kN); {STEPS}"],
    ),
    (
        {"a": [Level(1.0, left=1.5)], "b": [Level(1.0, left=1.0), Level(9.0, left=5.0), Level(1.0, left=2.0)]},
        ["beside that noise there is a smooth part that no general response to the drive explains (b 5 kN): " + SMOOTH],
    ),
    (
        {"a": [Level(1.0, left=2.5, resolution=1.0)], "b": [Level(1.0, left=3.25)], "c": [Level(1.0, short=True)]},
        [
            f"c: {FEW}",
            f"values were recorded in steps (a 1 kN); {STEPS}",
            "beside that noise there is a smooth part that no general response to the drive explains (a 2.5 kN, "
            "b 3.25 kN): " + SMOOTH,
        ],
    ),
])  # fmt: skip
def test_what_a_level_can_not_be_trusted_for_is_said_with_numbers(parts, said):
    assert caution(parts, "kN") == said
