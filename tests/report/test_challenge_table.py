"""Pictures of a graded challenge."""

import pytest

from tissuejax.report.challenge_table import figures, ratio_figure


@pytest.mark.parametrize("confusion", [{"drift": {"drift": 3, "periodic": 1}}, {}])
def test_a_challenge_without_single_effects_has_no_confusion_to_draw(tmp_path, confusion):
    drawn = figures({"confusion": confusion, "by_size": [], "calibration": {"bins": []}}, tmp_path)
    assert ("confusion" in drawn) == bool(confusion)
    assert all(path.read_bytes()[:4] == b"\x89PNG" for path in drawn.values())


def test_rates_by_ratio_stand_in_the_middle_of_their_bins_with_their_intervals():
    rows = [
        {"category": "one", "from": 0.0, "to": 0.25, "share": 0.8, "low": 0.6, "high": 0.9, "of": 20},
        {"category": "one", "from": 0.25, "to": 0.5, "share": 0.5, "low": 0.3, "high": 0.7, "of": 16},
    ]
    (ax,) = ratio_figure(rows).axes
    (points,) = [line for line in ax.lines if len(line.get_xdata()) == 2 and line.get_marker() == "o"]
    assert list(points.get_ydata()) == [0.8, 0.5]
    assert points.get_xdata() == pytest.approx([0.125, 0.375], abs=0.01)
    assert "36 cases" in ax.get_legend().get_texts()[0].get_text()
