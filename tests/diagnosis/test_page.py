"""The page of a diagnosis and its figures, as data, on benches in closed form; drawing is only checked to happen."""

import re
from dataclasses import replace

import numpy as np
import pytest
from spring_bench import judged, spring

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.judge import judge
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.diagnosis.specimens import Specimens, brief
from tissuejax.diagnosis.stiffness_map import StiffnessMap
from tissuejax.estimation.series import Segment
from tissuejax.report import diagnosis_sentences as sentences
from tissuejax.report import judged_sentences
from tissuejax.report.diagnosis_map import DiagnosisMap, strongest
from tissuejax.report.diagnosis_markers import DiagnosisMarkers
from tissuejax.report.diagnosis_page import write_diagnosis
from tissuejax.report.diagnosis_remainder import DiagnosisRemainder
from tissuejax.report.diagnosis_specimens import DiagnosisSpecimens

QUICK = Effort(most=1, singles=4, reshaped=(0, 0, 0))


def diagnosed(bench, **more):
    return Diagnosis("spring", "cubic", judged(bench, QUICK), 1.0, **more)


@pytest.fixture(scope="module")
def relaxing():
    return diagnosed(spring({"relax.g": 0.2, "relax.tau": 0.6}))


@pytest.fixture(scope="module")
def stepping():
    """Something that no candidate explains."""
    bench = spring({})
    for s in bench.segments:
        bench.y[s.rows] += {"r1": 1.0, "r2": -0.6, "r3": 1.4}[s.recording] * (s.time > 9.0)
    return diagnosed(bench)


def test_what_a_user_prints_are_plain_numbers(relaxing, stepping):
    def leaves(told):
        if isinstance(told, dict):
            return [leaf for key, value in told.items() for leaf in (key, *leaves(value))]
        return [leaf for value in told for leaf in leaves(value)] if isinstance(told, list | tuple) else [told]

    for found in (relaxing, stepping):
        kinds = {type(leaf) for leaf in leaves(found.as_dict())}
        assert {float, int, str} <= kinds
        assert all(k.__module__ == "builtins" for k in kinds), kinds


def test_the_page_tells_the_story_in_its_order(relaxing, tmp_path):
    page = write_diagnosis(relaxing, tmp_path)["page"].read_text()
    assert not re.search(r'(src|href)="(?!data:)', page), "the page points outside itself"
    told = [t.replace("&#39;", "'") for t in re.findall(r"<h2>(.*?)</h2>", page)]
    assert page.index('alt="measured"') < page.index("<h2>"), "the first figure is what was measured"
    assert told == [
        "What the residual looks like, before and after",
        "Where the base model misses",
        "The physics that was missing",
        "How sure",
        "What this can't tell",
        "Before and after, in numbers",
        "What to measure next",
        "What is still missing",
        "What was tried",
    ]
    assert "Missing: relax" in page
    assert page.count("data:image/png;base64,") >= 4


def test_sentences_say_how_sure_and_against_what(relaxing):
    lines = " ".join(judged_sentences.sure(relaxing))
    assert "The most probable is given" in lines
    assert "Probability that an effect is present" in lines
    found = re.search(r"misfit over the stated noise: ([\d.]+) .*with .* alone, ([\d.]+) .*with relax", lines)
    assert float(found[1]) > 1.5 > 1.1 > float(found[2]) > 0.9
    assert "second specimen" in sentences.next_steps(relaxing)[0]


def test_a_page_says_where_the_answer_hangs_on_how_rare_faults_are(relaxing):
    """Two names of the same evidence, one a fault: 0.91 for the tissue's, and even where both are as likely."""
    answered = relaxing.answered
    none, of = (next(s for s in answered.evidence.sets if s.names == n) for n in ((), ("relax",)))
    sets = (none, of, replace(of, names=("lag",), keys=("lag",)))
    evidence = replace(answered.evidence, sets=sets, forms={"relax": 1, "lag": 1}, faults=("lag",))
    rare, hint = judge(evidence), "Were it as likely, the answer would be ambiguous"
    assert rare.names == ("relax",)
    shown = replace(relaxing, answered=replace(answered, evidence=evidence, judgement=rare))
    assert any(hint in line and "10 times" in line for line in judged_sentences.sure(shown))
    assert not any("Were it as likely" in line for line in judged_sentences.sure(relaxing))


@pytest.mark.parametrize(
    ("known", "said"),
    [("verified", "100 times less likely than what a tissue does."), ("usual", ""), ("unchecked", "for as likely as")],
)
def test_page_and_record_say_what_was_told_of_the_machine(relaxing, known, said):
    """Where it decides nothing too: a reader can't know otherwise that somebody has told something."""
    answered, criteria = relaxing.answered, Criteria.of_rig(known)
    evidence = replace(answered.evidence, faults=("lag",))
    told = replace(answered, evidence=evidence, exploration=replace(answered.exploration, criteria=criteria))
    shown = replace(relaxing, answered=told)
    lines = [line for line in judged_sentences.sure(shown) if "a fault of the test machine" in line]
    assert [said in line for line in lines] == ([True] if said else [])
    assert shown.as_dict()["unusual"] == ({"criteria.fault": criteria.fault} if said else {})


def test_a_page_says_where_more_is_laid_to_a_simulation_than_two_of_them_say(relaxing, monkeypatch):
    answered = relaxing.answered
    rest = answered.rest() | {"parts": {"mesh": 1.9, "speed": 5.65}}
    monkeypatch.setattr(type(answered), "rest", lambda self: rest)
    said = [line for line in judged_sentences.sure(relaxing) if "something else may hide there" in line]
    assert len(said) == 1
    assert "speed of the simulation leaves open would have to be 5.7 times" in said[0]
    assert "a lower `compression`" in said[0]


def test_a_page_says_how_often_evidence_of_simulations_says_nothing(relaxing):
    answered = relaxing.answered
    assert not any("Once in" in line for line in judged_sentences.sure(relaxing))
    few = replace(relaxing, answered=replace(answered, evidence=replace(answered.evidence, simulated=True)))
    assert sum("Once in 5 a search by few simulations" in line for line in judged_sentences.sure(few)) == 1


def test_what_is_unexplained_sends_the_reader_to_the_remainder(stepping):
    assert stepping.verdict.kind == "unexplained"
    assert "remainder" in sentences.next_steps(stepping)[0]
    plot = DiagnosisRemainder()
    data = plot.prepare(stepping)
    assert data[0].share["time"] > data[0].share["drive"]
    assert "a function of time" in plot.caption(data)
    assert plot.draw(data) is not None


def test_the_lead_says_when_something_happened_at_once_before_it_says_that_nothing_explains_it(stepping, monkeypatch):
    assert stepping.answered.rest()["at_once"] == []
    assert "at once" not in judged_sentences.lead(stepping)
    moments = [
        {"recording": "last", "time": 7.04, "amplitude": 0.2},
        {"recording": "slow", "time": 10.0, "amplitude": 0.1},
    ]
    rest = stepping.answered.rest() | {"at_once": moments}
    monkeypatch.setattr(type(stepping.answered), "rest", lambda self: rest)
    assert judged_sentences.lead(stepping).startswith("Something happened at once")
    assert "in last at 7.04 s and slow at 10 s:" in judged_sentences.lead(stepping)
    moments[:] = [{"recording": "last", "time": 7.04, "amplitude": 0.0004}]
    assert "at once" not in judged_sentences.lead(stepping), "less than a thousandth is no news"


def test_noise_has_no_picture_of_a_remainder(relaxing):
    assert DiagnosisRemainder().prepare(relaxing) is None


def test_markers_and_maps_are_shown_where_there_are_some(relaxing, rng):
    assert DiagnosisMarkers().prepare(relaxing) is None
    assert DiagnosisMap().prepare(relaxing) is None
    bench, n, t = spring({}), 40, np.arange(40.0)
    depth = np.interp(t, [0, 20, 39], [0, 5e-3, 5e-3])
    places = [(x, y, 0.0) for x in (0.0, 0.01, 0.02) for y in (0.0, 0.01)]
    bench.segments, rows, missed = [], [], []
    for j, place in enumerate(places):
        for a, rest in zip("xyz", place, strict=True):
            at = slice(len(rows) * n, (len(rows) + 1) * n)
            bench.segments.append(Segment("r1", "markers", f"marker {j} {a}", at, t, "m", depth, "depth", "m"))
            rows.append(rest + 1e-5 * rng.standard_normal(n))
            missed.append(5e-4 * (j == 4 and a == "x") * depth / 5e-3)
    bench.y, bench.sigma = np.concatenate(rows), np.full(n * len(rows), 1e-5)
    bench.fitted, bench.held_out, bench.candidates = ("r1",), (), {}
    bench.predict = lambda values, recordings=None: bench.y - np.concatenate(missed)
    bench.jacobian = lambda values, paths, recordings=None: np.zeros((len(bench.y), len(paths)))
    centres = np.array([[x, y, z] for x, y, _ in places for z in (0.001, 0.003)])
    gain = np.where(np.arange(12) == 9, 5.0, 0.1)
    maps = [StiffnessMap("r1", centres, np.zeros((0, 8), int), centres, gain, gain)]
    d = diagnosed(bench, maps=maps)
    seen = DiagnosisMarkers().prepare(d)
    assert int(np.argmax(seen[0].chi_before)) == 4
    assert "marker 4 in r1" in DiagnosisMarkers().caption(seen)
    views = DiagnosisMap().prepare(d)
    assert len(views[0].above[0]) == 6  # elements behind each other count once
    assert views[0].above[2].max() == 5.0
    assert "stiffer" in DiagnosisMap().caption(views)
    for plot, data in ((DiagnosisMarkers(), seen), (DiagnosisMap(), views)):
        assert plot.draw(data) is not None


def test_of_what_lies_behind_the_strongest_counts():
    a, b, c = strongest(np.array([0.0, 0.0, 1.0]), np.zeros(3), np.array([1.0, -2.0, 0.5]))
    assert sorted(zip(a.tolist(), c.tolist(), strict=True)) == [(0.0, -2.0), (1000.0, 0.5)]


def test_many_specimens_are_counted(relaxing, stepping):
    many = Specimens({"a": brief(relaxing), "b": brief(stepping), "c": brief(relaxing)})
    assert many.verdicts == {"found": 2, "unexplained": 1}
    assert many.counts == {"relax": 2}
    assert many.first() == {"relax": 2}
    assert many.sentence().startswith("a: found, relax; b: unexplained, ")
    assert many.records["a"]["rmse_over_peak"]["after"]["held_out"] < 0.01
    plot = DiagnosisSpecimens()
    data = plot.prepare(many)
    assert "relax in 2 of 3" in plot.caption(data)
    assert data["effects"][0] == "relax"
    assert np.isnan(data["rank"][1, 0]) or "relax" in many.records["b"]["best_attempt"]
    assert plot.draw(data) is not None
