"""Pictures of a graded challenge."""

import pytest

from tissuejax.report.challenge_table import figures


@pytest.mark.parametrize("confusion", [{"drift": {"drift": 3, "periodic": 1}}, {}])
def test_a_challenge_without_single_effects_has_no_confusion_to_draw(tmp_path, confusion):
    drawn = figures({"confusion": confusion, "by_size": [], "calibration": {"bins": []}}, tmp_path)
    assert ("confusion" in drawn) == bool(confusion)
    assert all(path.read_bytes()[:4] == b"\x89PNG" for path in drawn.values())
