"""Bars of an ablation: halved to the left, doubled to the right, the number that changes most at the top."""

from tissuejax.report.matters import matters_figure


def test_a_bar_is_as_long_as_answers_change():
    rows = [
        {"number": "rig", "factor": 0.5, "changed": 1}, {"number": "rig", "factor": 2.0, "changed": 3},
        {"number": "shape", "factor": 0.5, "changed": 0}, {"number": "shape", "factor": 2.0, "changed": 2},
    ]  # fmt: skip
    (ax,) = matters_figure(rows, "changed").axes
    names = [t.get_text() for t in ax.get_yticklabels()]
    assert names == ["shape", "rig"], "the last is at the top"
    bars = {(names[round(p.get_y() + p.get_height() / 2)], p.get_width()) for p in ax.patches}
    assert bars == {("rig", -1.0), ("rig", 3.0), ("shape", 0.0), ("shape", 2.0)}
    assert ax.get_xlim()[0] < -3 < 3 < ax.get_xlim()[1]
    assert "changed" in ax.get_xlabel()
