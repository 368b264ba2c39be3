"""Recordings as one long vector, and the store of finished runs."""

import numpy as np
import pytest

from tissuejax.estimation.finished import Finished
from tissuejax.estimation.numerical import REMAINS, remaining
from tissuejax.estimation.series import Series
from tissuejax.recordings.recording import Channel, Recording, Sample

TIME = np.arange(4.0)
TWO = np.array([[1.0, 10.0], [2.0, np.nan], [3.0, 30.0], [4.0, 40.0]])
PULL = Recording(
    "pull",
    "uniaxial",
    {"time": TIME, "stretch": 1 + 0.1 * TIME},
    {"nominal_stress": Channel(TIME, 5 + TIME, "Pa", 1.0)},
)
BOTH = Recording(
    "both",
    "biaxial",
    {"time": TIME, "stretch": np.stack([1 + TIME, 2 + TIME], 1)},
    {"nominal_stress": Channel(TIME, TWO, "Pa", 1.0)},
)
SAMPLE = Sample("two", {"pull": PULL, "both": BOTH})
WANTED = {"pull": ("nominal_stress",), "both": ("nominal_stress",)}


def test_components_lie_one_after_the_other_without_lost_samples():
    cut = Series.of(SAMPLE, WANTED)
    assert cut.y.tolist() == [5, 6, 7, 8, 1, 2, 3, 4, 10, 30, 40]
    assert [s.component for s in cut.segments] == ["", "axis 1", "axis 2"]
    assert cut.segments[2].time.tolist() == [0, 2, 3]
    assert cut.segments[2].drive.tolist() == [2, 4, 5]
    assert cut.segments[0].drive_name == "stretch"
    assert cut.rows() == {("pull", "nominal_stress"): slice(0, 4), ("both", "nominal_stress"): slice(4, 11)}


def test_a_prediction_is_cut_as_the_measurement_was():
    cut = Series.of(SAMPLE, WANTED)
    assert cut.predicted(SAMPLE.recordings).tolist() == cut.y.tolist()
    whole = Series.of(SAMPLE, WANTED, lost=True)
    assert np.isnan(whole.y[9])
    assert len(whole.y) == 12


def test_short_segments_and_samples_that_take_no_part_are_left_out():
    assert len(Series.of(SAMPLE, WANTED, fewest=4).segments) == 2
    late = Series.of(SAMPLE, WANTED, taking=lambda recording, channel: TIME > 1)
    assert late.y.tolist() == [7, 8, 3, 4, 30, 40]


def test_finished_runs_are_found_again_in_memory_and_on_disk(tmp_path):
    runs = Finished(tmp_path / "runs", "what they depend on")
    assert runs.missing(["a", "b", "a"]) == ["a", "b"]
    runs.keep("a", np.arange(3.0))
    assert runs.missing(["a", "b"]) == ["b"]
    again = Finished(tmp_path / "runs", "what they depend on")
    assert again.unknown(["a"]) == ["a"]
    assert again.missing(["a"]) == []
    assert again["a"].tolist() == [0, 1, 2]
    assert Finished(tmp_path / "runs", "something else").missing(["a"]) == ["a"]
    again.forget()
    assert not (tmp_path / "runs").exists()
    assert Finished().missing(["a"]) == ["a"]


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_what_is_left_to_the_limit_follows_from_one_change(order):
    """e(h) = c h^p: from the change between h and h/2, what is left at h/2, and at h."""
    coarse, fine = 0.3 * 1.0**order, 0.3 * 0.5**order
    assert remaining(2.0, order) * (fine - coarse) == pytest.approx(-fine)
    assert remaining(2.0, order, seen_coarse=True) * (fine - coarse) == pytest.approx(-coarse)


def test_an_error_of_a_penalty_is_twice_what_doubling_it_changes():
    assert REMAINS["penalty"] == 2.0
    assert REMAINS["step"] == 1.0
