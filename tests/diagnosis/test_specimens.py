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


def test_the_key_names_what_is_drawn_and_lies_beside_it():
    """Every colour and mark of a picture of all answers, and of a picture of one; nothing of it over the panels."""
    rows = {kind: {"verdict": kind, "effects": [], "best_attempt": [], "rmse_over_peak": ERRORS} for kind in NAMING}
    rows["found"]["effects"], rows["unexplained"]["best_attempt"] = ["slack"], ["drift/linear"]
    plot = DiagnosisSpecimens()
    data = plot.prepare(Specimens(rows))
    squares = ["effect found, the first darkest", "best attempt, unexplained"]
    marks = ["found in part", "ambiguous", "unexplained", "nothing missing"]
    errors = ["base model, fitted", "with the effects, fitted"]  # nothing was held out
    assert [line.get_label() for line in plot.key(data)] == [*squares, *marks, *errors]
    alone = plot.prepare(Specimens({"nothing-missing": rows["nothing-missing"]}))
    assert [line.get_label() for line in plot.key(alone)] == ["nothing missing", *errors]
    figure = plot.draw(data)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert not any(legend.get_window_extent().overlaps(ax.get_tightbbox()) for ax in figure.axes)
