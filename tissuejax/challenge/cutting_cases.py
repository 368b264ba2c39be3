"""Sealed cuts: a sample of three strokes, one effect or none in it, forces from an implicit foundation model.

Laws differ from the diagnosis' own: toughness along the path is a random smooth field, a dull blade wears off towards a
limit, speed acts by its logarithm, a capsule is a layer with an edge, settling follows a logarithm, drift bends.
"""

from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from tissuejax.challenge.cutting_foundation import Knife, Slab
from tissuejax.challenge.cutting_foundation import draw as drawn
from tissuejax.storage import replacing

EFFECTS = (
    "blade-friction",
    "toughness-map",
    "rate-toughness",
    "dulling",
    "entry-skin",
    "depth-error",
    "settling",
    "drift",
)
NULLS = 4  # every fourth case has nothing in it
HEIGHT = 0.012


class Trial(NamedTuple):
    """One stroke: name, time s, x of the edge m, depth of cut m, how far the cut reached before, m."""

    name: str
    time: np.ndarray
    x: np.ndarray
    depth: np.ndarray
    notch: float


class Case(NamedTuple):
    """name, trials, force of each (N), noise (N), slab, knife, and the key."""

    name: str
    trials: list[Trial]
    force: dict[str, np.ndarray]
    noise: float
    slab: Slab
    knife: Knife
    key: dict


def draw(name: str, seed: int, index: int) -> Case:
    """Case `index` of a seed: it depends on these two alone."""
    rng = np.random.default_rng([seed, index, 77])
    picked = None if index % NULLS == 0 else EFFECTS[(index - index // NULLS - 1) % len(EFFECTS)]
    slab = Slab(0.04, rng.uniform(0.008, 0.015), mu := rng.uniform(1000, 4000), 12 * mu, rng.uniform(0.2, 1.0))
    knife = Knife(rng.uniform(3.5e-4, 8e-4), np.tan(np.radians(rng.uniform(10, 18))), 0.0)
    G, tau = rng.uniform(8, 40), rng.uniform(2.0, 2.6)
    tau = tau * G / knife.thickness  # parts within about the thickness of the blade
    knife = knife._replace(penalty=80 * tau / knife.thickness)
    trials = _strokes(rng, slab)
    pure = {t.name: _force(t, slab, knife, G, tau, None, rng) for t in trials}
    top = max(float(f.max()) for f in pure.values())
    noise = 0.01 * top * rng.uniform(0.5, 1.5)
    size, force, strength = 0.0, pure, 1.0
    state = rng.bit_generator.state
    for _ in range(4 if picked else 0):  # until it is 3 to 15 times the noise beside a rescaled toughness
        rng.bit_generator.state = state
        force = {t.name: _force(t, slab, knife, G, tau, picked, rng, strength) for t in trials}
        a, b = (np.concatenate([f[t.name] for t in trials]) for f in (pure, force))
        size = float(np.sqrt(np.mean((b - a * (a @ b) / (a @ a)) ** 2)) / noise)
        if 3 < size < 15:
            break
        strength *= float(np.clip(6 / max(size, 1e-3), 0.2, 5.0))
    seen = {t.name: f + noise * rng.standard_normal(len(f)) for t, f in zip(trials, force.values(), strict=True)}
    key = {
        "category": "one" if picked else "none", "effects": [picked] if picked else [], "plain": {},
        "size_over_noise": {picked: size} if picked else {}, "truth": {"G": G, "strength_Pa": tau, "amount": strength},
        "noise": {"std": noise, "correlation": 0.0}, "held_out": trials[-1].name,
        "truth_error_over_noise": {t.name: 1.0 for t in trials},
    }  # fmt: skip
    return Case(name, trials, seen, noise, slab, knife, key)


def _strokes(rng, slab) -> list[Trial]:
    """A cut with a rest, a stroke back and half a second pass; a faster one in fresh tissue; a shallower one."""
    out = []
    for name, legs, speed, deep in (
        ("there-back-again", (-0.003, 0.016, 0.016, 0.034, 0.004, 0.028), 2e-3, 0.009),
        ("fast", (-0.003, 0.034, 0.012), 2e-2, 0.009),
        ("shallow", (-0.003, 0.034, 0.012), 5e-3, 0.005),
    ):
        time, x = [0.0], [legs[0]]
        for a, b in zip(legs, legs[1:]):
            n = 80
            last = 8.0 if a == b else abs(b - a) / speed
            time += list(time[-1] + last * np.arange(1, n + 1) / n)
            x += list(a + (b - a) * np.arange(1, n + 1) / n)
        x = np.array(x)
        depth = np.where((x > 0) & (x < slab.length), deep * rng.uniform(0.95, 1.05), 0.0)
        out.append(Trial(name, np.array(time), x, depth, 0.0))
    return out


def _force(t: Trial, slab, knife, G, tau, effect, rng, amount=1.0) -> np.ndarray:
    speed = np.gradient(t.x, t.time)
    pace = float(np.max(np.abs(speed)))
    toughness = lambda x: np.full_like(x, G)  # noqa: E731
    depth, began = t.depth.copy(), t.time[int(np.argmax(t.x > 0))]
    if effect == "toughness-map":
        knots = np.clip(1 + 0.25 * amount * rng.standard_normal(9), 0.2, 4.0)
        toughness = lambda x: G * np.interp(x, np.linspace(0, slab.length, 9), knots)  # noqa: E731
    elif effect == "rate-toughness":
        toughness = lambda x: np.full_like(x, G * (1 + 0.1 * amount * np.log1p(pace / 1e-3)))  # noqa: E731
    elif effect == "dulling":
        toughness = lambda x: G * (1 + 0.6 * amount * (1 - np.exp(-x / 0.025)))  # noqa: E731
    elif effect == "entry-skin":
        toughness = lambda x: G * (1 + 1.0 * amount / (1 + np.exp((x - 0.003) / 4e-4)))  # noqa: E731
    elif effect == "depth-error":
        depth = np.where(depth > 0, np.maximum(depth + amount * (4e-4 + 0.02 * t.x), 0), 0)
    elif effect == "settling":
        depth = depth * (1 - np.clip(0.04 * amount * np.log1p(np.maximum(t.time - began, 0) / 1.5), 0, 0.8))
    rub = 0.06 * amount * np.tanh(speed / 2e-4) if effect == "blade-friction" else 0.0
    force = drawn(slab, knife, t.x, toughness, lambda x: np.full_like(x, tau), notch=t.notch, friction=rub) * depth
    if effect == "drift":
        u = (t.time - t.time[0]) / np.ptp(t.time)
        force = force + 0.06 * amount * np.max(np.abs(force)) * (0.5 + u + 0.3 * u**2)
    return force


def write(case: Case, path: Path) -> None:
    """The recordings of a case, without a word on the truth."""
    half, height, length = case.slab.half, HEIGHT, case.slab.length
    corner = np.array([[x, y, z] for z in (0, height) for y in (-half, half) for x in (0, length)])
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs.update({"format": "tissue-recording", "version": 1, "sample": case.name, "density": 1060.0})
        body = file.create_group("geometry")
        body["points"], body["fixed"] = corner, np.array([0, 1, 2, 3])
        body["cells"] = np.array([[0, 1, 3, 2, 4, 5, 7, 6]])
        body["cells"].attrs["cell_type"] = "hexahedron"
        group = file.create_group("recordings", track_order=True)
        for t in case.trials:
            r = group.create_group(t.name)
            r.attrs["experiment"] = "cutting"
            r.attrs["blade/angle"] = 2 * np.degrees(np.arctan(case.knife.slope))
            tip = np.stack([t.x, 0 * t.x, height - np.maximum(t.depth.max(), 1e-3) + 0 * t.x], 1)
            r["blade/time"], r["blade/tip"] = t.time, tip
            r["blade/profile"] = np.array([[0.0, 0.0], [0.0, 0.015]])
            r["blade"].attrs["thickness"] = case.knife.thickness
            r["depth"] = t.depth
            value = np.stack([-case.force[t.name], 0 * t.x, 0 * t.x], 1)
            r["force/time"], r["force/value"] = t.time, value
            r["force"].attrs["noise_std"] = case.noise
