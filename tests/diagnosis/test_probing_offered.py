"""What probings can't show is not offered, and the reader is told."""

import numpy as np
import pytest

from tests.probing.bench import recording, sample
from tissuejax.diagnosis.catalogue import Entry
from tissuejax.diagnosis.kinds.probings import Probings
from tissuejax.diagnosis.kinds.recorded import Question
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_catalogue import probing_entries
from tissuejax.diagnosis.probing_offered import WITHOUT, Pressed, pressed
from tissuejax.effects.catalogue import needs
from tissuejax.effects.form import Probed
from tissuejax.energies.catalogue import energy
from tissuejax.estimation.series import Segment
from tissuejax.model import Model

DOWN = np.linspace(0, 3e-3, 60)
BACK = np.concatenate([DOWN[::2], DOWN[::-2]])
MODEL = Model(energy("neo-hookean"))


def forces(*depths, channel="force"):
    time = [np.linspace(0, 3, len(d)) for d in depths]
    return [
        Segment(f"r{i}", channel, "z", slice(60 * i, 60 * i + len(d)), t, "N", d, "depth", "m")
        for i, (d, t) in enumerate(zip(depths, time, strict=True))
    ]


def candidates():
    made: list[Entry] = probing_entries(Probed(1000.0, 0.02, 100.0))
    return {c.key: c for e in made for c in e.declare(MODEL, ("r0",), ())[2]}


@pytest.mark.parametrize(
    ("segments", "seen"),
    [
        (forces(DOWN), {"force-hum"}),
        (forces(BACK), {"force-hum", "hysteresis"}),
        (forces(DOWN, DOWN), {"force-hum", "specimen-scatter"}),
        (forces(BACK, DOWN), {"force-hum", "specimen-scatter", "hysteresis"}),
        (forces(BACK[::4]), {"hysteresis"}),
        (forces(BACK, np.zeros(60)), {"force-hum", "hysteresis"}),  # the second never touches
        (forces(BACK, BACK, channel="markers"), set()),
    ],
    ids=["down", "and back", "two down", "two, one back", "few samples", "one in the air", "no force"],
)
def test_what_the_protocol_does_not_show_is_not_offered(segments, seen):
    kept, said = pressed(segments, candidates())
    assert {c.name for c in kept.values()} & set(needs("probing")) == seen
    for name in set(needs("probing")) - seen:
        assert any(name in s and WITHOUT[needs("probing")[name]] in s for s in said)


def test_names_that_were_not_asked_for_are_not_offered():
    kept, _ = pressed(forces(BACK, BACK), candidates(), ["hysteresis"])
    assert [c.name for c in kept.values() if c.widens] == ["hysteresis"]


def test_every_need_is_a_property_of_probings_and_has_words():
    protocol = Pressed.of(forces(BACK))
    assert set(needs("probing")) == {"specimen-scatter", "hysteresis", "force-hum"}
    for need in needs("probing").values():
        assert isinstance(getattr(protocol, need), bool)
        assert WITHOUT[need]


def test_a_diagnosis_of_one_press_is_told_what_it_can_not_show(monkeypatch):
    monkeypatch.setattr(ProbingBench, "_scale", lambda self: 1.0)  # nothing is simulated here
    question = Question(sample(recording("a")), energy("neo-hookean"), "neo-hookean", ("a",), (), {}, None, None)
    made = Probings.of(question)
    names = {c.name for c in made.whole.candidates.values()}
    assert {"hysteresis", "force-hum", "friction"} <= names
    assert "specimen-scatter" not in names
    assert any("specimen-scatter" in s and "one force only" in s for s in made.remarks)
