"""Derivatives of probings that need no run of their own.

What only sensors feel follows from the prediction itself. What only moves the probe, the support or the rig follows
from three runs with the probe displaced, one an axis: without memory the state depends on where the probe is now, so
with slopes s_i = dy/dc_i of everything measured by the probe's place,

    a probe by d lower:          -s_z d              a support that moves by w(t):   -s . w(t), markers + w(t)
    a probe late by d:           -s . c'(t) d        a rig that gives way by k:       s . k F(t), F on the probe.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import equinox as eqx
import numpy as np

from tissuejax.diagnosis.probing_series import CHANNELS, filled, picked, put
from tissuejax.effects.effect import Effect
from tissuejax.experiments.probing_sensors import smooth_path
from tissuejax.recordings.recording import Channel

if TYPE_CHECKING:
    from tissuejax.diagnosis.probing import ProbingBench

ASIDE = {
    "x": ("effects.registration.dx", 3e-4),
    "y": ("effects.registration.dy", 3e-4),
    "z": ("effects.contact-offset.depth", -3e-4),
}


def sensed(bench: "ProbingBench", path: str) -> bool:
    """Whether a parameter only changes what the sensors report."""
    if not path.startswith("effects."):
        return False
    return _silent(bench.runs.effects[path.split(".")[1]]) or path == "effects.registration.turn"


def _silent(effect: Effect) -> bool:
    return type(effect).scene is Effect.scene and type(effect).energy is Effect.energy


def moves(bench: "ProbingBench", at: Mapping[str, float], path: str) -> bool:
    """Whether the derivative follows from a displaced probe: nothing that remembers, and no rig in between."""
    if not path.startswith("effects.") or path.split(".")[2] not in bench.runs.effects[path.split(".")[1]].displaces:
        return False
    on = {p.split(".")[1] for p, v in at.items() if p.startswith("effects.") and v != 0 and _amplitude(bench, p)}
    return not any(type(bench.runs.effects[n]).remembers and not _silent(bench.runs.effects[n]) for n in on)


def _amplitude(bench: "ProbingBench", path: str) -> bool:
    _, effect, name = path.split(".")[:3]
    return name in bench.runs.effects[effect].amplitudes


def _axes(path: str) -> str:
    return {"dx": "x", "dy": "y", "depth": "z", "lean_x": "x", "lean_y": "y"}.get(path.split(".")[2], "xyz")


def _own(path: str, wanted: tuple[str, ...]) -> tuple[str, ...]:
    """The recordings in which a path acts."""
    return tuple(r for r in wanted if r == path.rsplit(".", 1)[-1]) or wanted


def displaced(bench: "ProbingBench", at: Mapping[str, float], path: str, wanted: tuple[str, ...]) -> list:
    """The runs that `moving` needs."""
    own = _own(path, wanted)
    axes = [(a, ASIDE[a]) for a in _axes(path)]
    return [(at, own, bench.slopes), *((_shifted(at, p, h, own), own, bench.slopes) for _, (p, h) in axes)]


def _shifted(at: Mapping[str, float], path: str, h: float, own: tuple[str, ...]) -> dict[str, float]:
    several = {f"{path}.{r}": at[f"{path}.{r}"] + h for r in own if f"{path}.{r}" in at}
    return {**at, path: at.get(path, 0.0) + h} | several


def moving(bench: "ProbingBench", at: Mapping[str, float], path: str, wanted: tuple[str, ...]) -> np.ndarray:
    """Derivative by a parameter that moves probe or support."""
    own = _own(path, wanted)
    origin = bench.runs.many([(at, own, bench.slopes)])[0]
    slope = {}
    for axis in _axes(path):
        p, h = ASIDE[axis]
        shifted = bench.runs.many([(_shifted(at, p, h, own), own, bench.slopes)])[0]
        slope[axis] = (shifted - origin) / abs(h)  # upwards for z: the depth of a contact offset counts downwards
    out = np.zeros(len(bench.y))
    for r in own:
        motion = _motion(bench, at, path, r, origin)
        for s in bench.segments:
            if s.recording == r:
                for axis, way in motion.items():
                    out[s.rows] += slope[axis][s.rows] * way(s.time)
                way = motion.get(s.component[-1])
                if path.startswith("effects.support-motion.") and s.channel == "markers" and way is not None:
                    out[s.rows] -= way(s.time) - _calm(bench, r, way)
    return out


def _calm(bench: "ProbingBench", recording: str, way) -> float:
    """Mean of a motion over the frames out of contact, from which the markers' rest is taken."""
    setup = bench.ready.setups[recording]
    weights = np.asarray(setup.calm, float)
    return float(weights @ way(np.asarray(setup.scene.clock.ends, float))) if weights.sum() > 0 else 0.0


def _wave(at: Mapping[str, float], name: str, time: np.ndarray) -> np.ndarray:
    angle = 2 * np.pi * at["effects.support-motion.frequency"] * time * (2 if name.endswith("2") else 1)
    return np.sin(angle) if name.startswith("sin") else np.cos(angle)


def _lift(at: Mapping[str, float], recording: str, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The support's lift and its derivative by the frequency."""
    out, slope = np.zeros(len(time)), np.zeros(len(time))
    turned = {"sin": ("cos", 1), "cos": ("sin", -1), "sin2": ("cos2", 2), "cos2": ("sin2", -2)}
    for name, (other, factor) in turned.items():
        a = at.get(f"effects.support-motion.{name}.{recording}", at.get(f"effects.support-motion.{name}", 0.0))
        out += a * _wave(at, name, time)
        slope += a * factor * 2 * np.pi * time * _wave(at, other, time)
    return out, slope


def _motion(bench: "ProbingBench", at: Mapping[str, float], path: str, recording: str, origin: np.ndarray) -> dict:
    """How the probe moves towards the tissue per unit of the parameter: functions of time by axis, z upwards."""
    name = path.split(".")[2]
    if name in ("dx", "dy"):
        return {name[1]: lambda t: np.ones_like(t)}
    if name == "depth":
        return {"z": lambda t: -np.ones_like(t)}
    if path.startswith("effects.support-motion."):
        if name.startswith("lean"):
            return {name[-1]: lambda t: -_lift(at, recording, t)[0]}
        lean = {c: at.get(f"effects.support-motion.lean_{c}", 0.0) for c in "xy"} | {"z": 1.0}
        if name == "frequency":
            return {c: (lambda t, k=k: -k * _lift(at, recording, t)[1]) for c, k in lean.items()}
        return {c: (lambda t, k=k: -k * _wave(at, name, t)) for c, k in lean.items()}
    if name == "delay":
        time, place = smooth_path(bench.ready.sample.recordings[recording], bench.ready.settings.smoothing)
        rate = np.gradient(place, time, axis=0)
        return {c: (lambda t, i=i: -np.interp(t, time, rate[:, i])) for i, c in enumerate("xyz")}
    felt = {s.component: s for s in bench.segments if s.recording == recording and s.channel == "force"}
    return {c: (lambda t, s=s: np.interp(t, s.time, origin[s.rows])) for c, s in felt.items()}


def reported(bench: "ProbingBench", at: Mapping[str, float], path: str, h: float, origin: np.ndarray) -> np.ndarray:
    """Derivative by a parameter of sensors, from the prediction `origin`."""
    effect, out = bench.runs.effects[path.split(".")[1]], np.zeros(len(bench.y))
    for name in (*bench.fitted, *bench.held_out):
        before, after = (_report(bench, effect, {**at, path: at[path] + d}, name, origin) for d in (0.0, h))
        for s in bench.segments:
            if s.recording == name and s.channel in after:
                out[s.rows] = picked(after[s.channel] - before[s.channel], s, bench.finite) / h
    return out


def _report(bench: "ProbingBench", effect: Effect, values: Mapping[str, float], name: str, origin: np.ndarray) -> dict:
    """What the sensors report of the prediction `origin` under one effect, full arrays.

    The prediction holds the effect already: what is asked for is only how its report changes, to first order.
    """
    measured, channels = bench.ready.sample.recordings[name].channels, {}
    for channel in CHANNELS:
        if channel in measured:
            full = filled(np.asarray(measured[channel].values, float))
            for s in bench.segments:
                if s.recording == name and s.channel == channel:
                    put(full, s, bench.finite, origin)
            channels[channel] = Channel(np.asarray(measured[channel].time, float), full, measured[channel].unit)
    p = {}
    for d in effect.parameters:
        generic = f"effects.{effect.name}.{d.name}"
        p[d.name] = values.get(f"{generic}.{name}", values.get(generic, effect.neutral[d.name]))
    out, test = {}, bench.ready.setups[name].test
    shown = channels["markers"].values.shape[1] if "markers" in channels else 0
    test = eqx.tree_at(lambda t: t.rest, test, test.rest[:shown])  # without the padding of the simulation
    for channel, ch in effect.channels(p, test, channels).items():
        t = np.asarray(measured[channel].time, float)
        flat = np.asarray(ch.values, float).reshape(len(t), -1)
        read = np.stack([np.interp(t, np.asarray(ch.time), flat[:, i]) for i in range(flat.shape[1])], axis=1)
        out[channel] = read.reshape(np.shape(ch.values))
    return out
