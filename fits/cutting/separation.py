"""What the next stroke is worth: toughness, wedging and friction from one pass, and with the strokes proposed.

Forces come from the implicit foundation model (`challenge/cutting_foundation.py`), which shares nothing with the
balance of energies that is fitted: toughness, bulk modulus (wedging) and friction of the blade all at once.
"""

from dataclasses import replace

import numpy as np

from tissuejax.challenge.cutting_cases import HEIGHT
from tissuejax.challenge.cutting_foundation import Knife, Slab, draw
from tissuejax.cohesion.catalogue import law
from tissuejax.diagnosis.next_cut import next_cut, planned
from tissuejax.effects.catalogue import effect
from tissuejax.energies.neo_hookean import NeoHookean
from tissuejax.energies.volumetric import Quadratic
from tissuejax.estimation.covariance import uncertainty
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.cut_balance import calm
from tissuejax.fitting.cut_result import ENERGY, FRICTION, ONSET
from tissuejax.fitting.least_squares import descend
from tissuejax.fitting.options import Unknowns
from tissuejax.fitting.setup import problem
from tissuejax.mesh.slab import across, block
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample

BULK, MU = "volumetric.K", 3000.0
TRUTH = {ENERGY: 20.0, FRICTION: 0.1, BULK: 12 * MU - 4 * MU / 3, "energy.mu": MU}
SLAB, BLADE, NOISE = Slab(0.04, 0.01, MU, 12 * MU, 0.0), Knife(5e-4, 0.25, 2e10), 0.002
FREE = (ENERGY, FRICTION, BULK, ONSET)


def stroke(name: str, time, x, depth, notch=0.0, seed=0) -> Recording:
    """One stroke through the slab by the foundation model, with noise."""
    rub = TRUTH[FRICTION] * np.tanh(np.gradient(x, time) / 2e-4)
    toughness, strength = (lambda at, v=v: np.full_like(at, v) for v in (TRUTH[ENERGY], 210e3))
    force = draw(SLAB, BLADE, x, toughness, strength, 1.2e-5, notch=notch, friction=rub) * depth
    force = force + NOISE * np.random.default_rng(seed).standard_normal(len(x))
    zero = np.zeros_like(x)
    inputs = {"blade/time": time, "blade/tip": np.stack([x, zero, HEIGHT - depth], 1), "depth": depth}
    edge = {"blade/profile": np.array([[0.0, 0.0], [0.0, 0.015]]), "blade/thickness": BLADE.thickness}
    more = {"blade/angle": 2 * np.degrees(np.arctan(BLADE.slope)), "notch": notch}
    channel = Channel(time, np.stack([-force, zero, zero], 1), "N", NOISE)
    return Recording(name, "cutting", inputs, {"force": channel}, edge | (more if notch else {**more, "notch": 0.0}))


def sample(*recordings: Recording) -> Sample:
    """The slab with these strokes."""
    body = block(np.linspace(0, SLAB.length, 7), across(SLAB.half, 5e-3), np.linspace(0, HEIGHT, 3), "base")
    return Sample("slab", {r.name: r for r in recordings}, body, 1000.0)


def explained(made: Sample, known: dict[str, float]):
    """The fit of everything that is not known: the predictor, the values, and the problem about them."""
    names = tuple(made.recordings)
    model = Model(NeoHookean(), Quadratic(), (effect("blade-friction"), effect("onset")), cohesion=law("bilinear"))
    p = predictor(model, calm(made, names), names)
    start = p.model.defaults | {"energy.mu": MU, ENERGY: 10.0, FRICTION: 0.05, BULK: 2e4} | known
    posed = problem(p, unknowns=Unknowns(free=tuple(q for q in FREE if q not in known), start=start))
    ended = descend(posed, start, max_steps=100)
    return p, posed.values(ended.y), posed, ended


def fitted(made: Sample) -> dict:
    """Toughness, friction and bulk modulus at once, in per cent off the truth, with their standard errors."""
    p, found, posed, ended = explained(made, {})
    _, J = posed.linearised(found)
    declared = p.model.parameters
    scale = np.array([declared[q].typical for q in FREE])
    std = uncertainty(J, ended.y, scale, FREE, tuple(declared[q].unit for q in FREE), 1.0).std
    out = {"strokes": " + ".join(made.recordings)}
    for q, s, said in zip(FREE[:3], std[:3], ("toughness", "friction", "bulk_modulus"), strict=True):
        out[f"{said}_off_percent"] = 100 * (found[q] / TRUTH[q] - 1)
        out[f"{said}_error_percent"] = 100 * float(s) / TRUTH[q]
    return out


def separated() -> dict:
    """One pass; what is proposed to tell two explanations of it apart; the fits with each of the proposed strokes."""
    x = np.linspace(-0.003, 0.034, 241)
    first = stroke("one pass", (x - x[0]) / 2e-3, x, np.full_like(x, 0.009), seed=1)
    alone = sample(first)
    model = explained(alone, {})[0].model.across(())
    # with the truth's friction, and without any: what the record alone hardly tells apart
    pair = [(model, explained(alone, {FRICTION: m})[1]) for m in (TRUTH[FRICTION], 0.0)]
    ranked = next_cut(alone, "one pass", *pair)
    runs = [fitted(alone)]
    for k, proposal in enumerate(planned(alone, "one pass")):
        r = proposal.recording
        tip = r.inputs["blade/tip"]
        depth = HEIGHT - tip[:, 2]
        made = stroke(r.name, r.inputs["blade/time"], tip[:, 0], depth, float(r.attributes.get("notch", 0.0)), 2 + k)
        runs.append(fitted(sample(first, replace(made, name=r.name))))
    return {"runs": runs, "proposed": [f"{s.what}: {s.apart:.0f} times the noise" for s in ranked]}
