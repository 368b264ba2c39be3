"""The next stroke tells friction, wedging and toughness apart, where one pass holds all three in one sum."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.cutting.records import VALUES, model, record, sample, strokes
from tissuejax.diagnosis.cutting import CuttingBench, strokes_to_settle
from tissuejax.diagnosis.next_cut import next_cut
from tissuejax.effects.catalogue import effect
from tissuejax.energies.neo_hookean import NeoHookean

TIME, X = strokes(-0.002, 0.025, rate=20.0)
SAMPLE = sample(record("one pass", TIME, X, 0.0 * X + 0.1))
FRICTION = "effects.blade-friction.coefficient"


def told(one, other):
    """Words of the stroke that tells two value sets apart best, and by how many times the noise."""
    made = model(effect("blade-friction"))
    best = next_cut(SAMPLE, "one pass", (made, VALUES | one), (made, VALUES | other))[0]
    return best.what, best.apart


def test_a_stroke_in_the_same_cut_tells_friction_and_wedging_from_toughness():
    """A second pass and a return have no toughness in them: two explanations that agree in a first pass to a per cent
    of it differ there by what one of them took for toughness."""
    rubbing = {FRICTION: 0.02}
    harder = {FRICTION: 0.0, "cohesion.energy": VALUES["cohesion.energy"] + 0.02 * 2 * 5e3 * 0.0125}
    what, apart = told(rubbing, harder)
    assert "same cut" in what or "return" in what
    assert apart > 3
    stiffer = {FRICTION: 0.0, "energy.mu": 2 * VALUES["energy.mu"], "volumetric.K": 2 * VALUES["volumetric.K"]}
    tough = {FRICTION: 0.0, "cohesion.energy": 1.5 * VALUES["cohesion.energy"]}
    what, apart = told(stiffer, tough)
    assert "same cut" in what or "return" in what
    assert apart > 3


def test_an_answer_with_a_rival_names_the_stroke():
    bench = CuttingBench.of(SAMPLE, NeoHookean(), ("one pass",), ())
    G = bench.start["cohesion.energy"]
    rubbing = SimpleNamespace(keys=("blade-friction",), all={FRICTION: 0.5, "cohesion.energy": 0.5 * G})
    dull = SimpleNamespace(keys=(), all={"cohesion.energy": G})
    said = strokes_to_settle(SAMPLE, bench, SimpleNamespace(chosen=rubbing, rivals=(dull,)))
    assert said
    assert said[0].startswith("blade-friction or nothing?")
    assert strokes_to_settle(SAMPLE, bench, SimpleNamespace(chosen=rubbing, rivals=())) == []


def test_one_pass_alone_can_not_tell_wedging_from_toughness():
    stiffer = VALUES | {"energy.mu": 1.1 * VALUES["energy.mu"], "volumetric.K": 1.1 * VALUES["volumetric.K"]}
    from tissuejax.experiments.predictor import predictor

    p = predictor(model(), SAMPLE)
    base, more = (np.asarray(p.predict(v)["one pass"].channels["cutting_force"].values) for v in (VALUES, stiffer))
    extra = float(np.mean((more - base)[-50:])) / 0.01
    tougher = VALUES | {"cohesion.energy": VALUES["cohesion.energy"] + extra}
    same = np.asarray(p.predict(tougher)["one pass"].channels["cutting_force"].values)
    assert same == pytest.approx(more, abs=1e-6)
