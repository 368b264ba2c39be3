"""What a page says of answers like its own is what was graded."""

import json
from pathlib import Path

import pytest

from tissuejax.report.track_record import RECORD, sentence

POOLED = Path(__file__).parents[2] / "fits" / "challenge" / "pooled.json"
SETS = {"homogeneous": ("material tests", "beside a rest"), "probing": ("probings", "probings beside a rest")}


@pytest.mark.parametrize("experiment", RECORD)
def test_the_record_is_that_of_the_graded_sets(experiment):
    graded = json.loads(POOLED.read_text())["by_answer"]
    counted: dict[str, list[float]] = {}
    for name in SETS[experiment]:
        for verdict, row in graded[name]["by_verdict"].items():
            so_far = counted.setdefault(verdict, [0, 0.0, 0.0])
            so_far[0] += row["of"]
            so_far[1] += row["share"] * row["of"]
            so_far[2] += row["stated"] * row["of"]
    assert set(counted) == set(RECORD[experiment])
    for verdict, (of, true, stated) in counted.items():
        held = RECORD[experiment][verdict]
        assert (held.of, held.true) == (of, round(true))
        assert held.stated == pytest.approx(stated / of, abs=0.006)


def test_too_few_answers_say_nothing():
    assert sentence("probing", "found-in-part") == ""
    assert sentence("cutting", "found") == ""
    held = RECORD["probing"]["found"]
    assert f"{held.true} of {held.of} answers of this kind were true" in sentence("probing", "found")
