"""Many specimens: what a verdict names is counted, whichever of the naming verdicts it is."""

import pytest

from tissuejax.diagnosis.judgement.judge import Kind
from tissuejax.diagnosis.specimens import Specimens
from tissuejax.report.diagnosis_specimens import DiagnosisSpecimens

ERRORS = {"before": {"fitted": 0.1}, "after": {"fitted": 0.01}}
NAMING = {"nothing-missing": False, "found": True, "found-in-part": True, "ambiguous": True, "unexplained": False}


@pytest.mark.parametrize(("kind", "speaks"), NAMING.items())
def test_every_answer_either_names_or_does_not(kind, speaks):
    assert {k.value for k in Kind} == set(NAMING)
    assert Kind(kind).speaks is speaks
    effects, attempt = (["slack"], []) if speaks else ([], ["slack/rounded"])
    many = Specimens({"a": {"verdict": kind, "effects": effects, "best_attempt": attempt, "rmse_over_peak": ERRORS}})
    plot = DiagnosisSpecimens()
    assert ("slack in 1 of 1" in plot.caption(plot.prepare(many))) is speaks
    assert many.counts == ({"slack": 1} if speaks else {})
