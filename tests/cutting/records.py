"""Cutting recordings for tests: any force given, or that of a simulation on a finer mesh with noise."""

import numpy as np

from tissuejax.cohesion.catalogue import law
from tissuejax.effects.catalogue import effect
from tissuejax.energies.neo_hookean import NeoHookean
from tissuejax.energies.volumetric import Quadratic
from tissuejax.experiments.cutting_run import CuttingSettings
from tissuejax.experiments.predictor import predictor
from tissuejax.mesh.slab import across, block
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample

VALUES = {"energy.mu": 1564.0, "volumetric.K": 2e4, "cohesion.strength": 4000.0, "cohesion.energy": 5.0}


def model(*effects) -> Model:
    """Neo-Hookean tissue that parts by the bilinear law."""
    return Model(NeoHookean(), Quadratic(), tuple(effects), cohesion=law("bilinear"))


def strokes(*legs, speed=2e-3, rate=50.0):
    """Times and x of a blade that goes from place to place at one speed, m and s."""
    x = [np.array([legs[0]])]
    for a, b in zip(legs, legs[1:]):
        n = max(2, int(abs(b - a) / speed * rate))
        x.append(np.linspace(a, b, n + 1)[1:])
    x = np.concatenate(x)
    return np.arange(len(x)) / rate, x


def record(name, time, x, force, depth=0.01, thickness=4e-4, noise=0.002, **attributes) -> Recording:
    """One cut along x at y = 0 through a block whose top is at z = 10 mm."""
    tip = np.stack([x, np.zeros_like(x), np.full_like(x, 0.01 - depth)], 1)
    value = np.stack([-np.asarray(force), np.zeros_like(x), np.zeros_like(x)], 1)
    profile = np.array([[0.0, 0.0], [0.0, 0.012]])
    return Recording(
        name, "cutting", {"blade/time": time, "blade/tip": tip}, {"force": Channel(time, value, "N", noise)},
        {"blade/thickness": thickness, "blade/profile": profile} | attributes,
    )  # fmt: skip


def sample(*recordings, length=0.03, half=0.01) -> Sample:
    """A block, 10 mm high, with these recordings."""
    body = block(np.linspace(0, length, 7), across(half, 5e-3), np.linspace(0, 0.01, 3), "base")
    return Sample("block", {r.name: r for r in recordings}, body, 1000.0)


TRUTH = {
    "energy.mu": 3000.0, "volumetric.K": 3.6e4, "cohesion.strength": 3000.0, "cohesion.energy": 2.0,
    "effects.blade-friction.coefficient": 0.1,
}  # fmt: skip


def simulated(h, noise, seed=3, notch=None, truth=None) -> Sample:
    """A blade of 2 mm drawn 14 mm into a slab and half the way back, with friction: forces of a simulation with
    elements of size `h` (m), and noise of `noise` times the greatest force. `truth`: what differs from `TRUTH`."""
    truth = TRUTH | (truth or {})
    time, x = strokes(-0.001, 0.014, 0.008, rate=40.0)
    more = {} if notch is None else {"notch": notch}

    def made(force, std):
        return sample(
            record("r", time, x, force, thickness=2e-3, noise=std, **more), length=0.02, half=0.005
        )  # fmt: skip

    p = predictor(
        model(effect("blade-friction")), made(0 * x + 0.1, 1e-3), by="simulation", settings=CuttingSettings(h=h),
        start=truth,
    )  # fmt: skip
    force = np.asarray(p.predict(truth)["r"].channels["cutting_force"].values)
    std = noise * float(force.max())
    return made(force + std * np.random.default_rng(seed).standard_normal(len(force)), std)
