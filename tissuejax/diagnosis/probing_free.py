"""Derivatives of probings that need no run of their own.

What only sensors feel follows from the prediction itself. What only moves the probe, the support or the rig follows
from three runs with the probe displaced, one an axis: without memory the state depends on where the probe is now, so
with slopes s_i = dy/dc_i of everything measured by the probe's place,

    a probe by d lower:          -s_z d              a support that moves by w(t):   -s . w(t), markers + w(t)
    a probe late by d:           -s . c'(t) d        a rig that gives way by k:       s . k F(t), F on the probe.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.probing_added import effect_values
from tissuejax.diagnosis.probing_series import CHANNELS, filled, picked, put
from tissuejax.effects.effect import Effect
from tissuejax.recordings.recording import Channel

if TYPE_CHECKING:
    from tissuejax.diagnosis.probing import ProbingBench

# by axis, an effect that sets the probe aside along it, and how far, m
ASIDE = {
    "x": ("effects.registration.dx", 3e-4),
    "y": ("effects.registration.dy", 3e-4),
    "z": ("effects.contact-offset.depth", -3e-4),
}


def sensed(bench: "ProbingBench", path: str) -> bool:
    """Whether a parameter only changes what the sensors report."""
    if not path.startswith("effects."):
        return False
    effect = bench.runs.effects[path.split(".")[1]]
    return _silent(effect) or path.split(".")[2] in effect.sensed


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


def _own(path: str, wanted: tuple[str, ...]) -> tuple[str, ...]:
    """The recordings in which a path acts."""
    return tuple(r for r in wanted if r == path.rsplit(".", 1)[-1]) or wanted


def displaced(bench: "ProbingBench", at: Mapping[str, float], path: str, wanted: tuple[str, ...]) -> list:
    """The runs that `moving` needs."""
    own = _own(path, wanted)
    asked = [_shifted(at, *ASIDE[axis], own) for axis in _axes(bench, at, path, own)]
    return [(values, own, bench.slopes) for values in (at, *asked)]


def _shifted(at: Mapping[str, float], path: str, h: float, own: tuple[str, ...]) -> dict[str, float]:
    several = {f"{path}.{r}": at[f"{path}.{r}"] + h for r in own if f"{path}.{r}" in at}
    return {**at, path: at.get(path, 0.0) + h} | several


def moving(bench: "ProbingBench", at: Mapping[str, float], path: str, wanted: tuple[str, ...]) -> np.ndarray:
    """Derivative by a parameter that moves probe or support."""
    own = _own(path, wanted)
    origin = bench.runs.many([(at, own, bench.slopes)])[0]
    slope = {}
    for axis in _axes(bench, at, path, own):
        _, h = ASIDE[axis]
        shifted = bench.runs.many([(_shifted(at, *ASIDE[axis], own), own, bench.slopes)])[0]
        slope[axis] = (shifted - origin) / abs(h)  # upwards for z: the depth of a contact offset counts downwards
    out = np.zeros(len(bench.y))
    for r in own:
        felt = {s.component[-1]: s for s in bench.segments if s.recording == r and s.channel == "force"}
        motion = Motion.of(bench, at, path, r)
        for s in bench.segments:
            if s.recording == r:
                for i, axis in enumerate("xyz"):
                    if axis in slope:
                        given = motion.gives[i] * np.interp(s.time, felt[axis].time, origin[felt[axis].rows])
                        out[s.rows] += slope[axis][s.rows] * (motion.towards(i, s.time) + given)
                if s.channel == "markers":
                    out[s.rows] += _carried(bench, motion, r, s.component[-1], s.time)
    return out


def _carried(bench: "ProbingBench", motion: "Motion", recording: str, axis: str, time: np.ndarray) -> np.ndarray:
    """How markers ride on the support, less the mean over the frames out of contact, from which their rest is taken."""
    setup, i = bench.ready.setups[recording], "xyz".index(axis)
    weights = np.asarray(setup.calm, float)
    rest = weights @ motion.carried(i, np.asarray(setup.scene.clock.ends, float)) if weights.sum() > 0 else 0.0
    return motion.carried(i, time) - rest


@dataclass(frozen=True)
class Motion:
    """What a unit of a parameter moves, by the effect's own scene.

    Attributes:
        time: s, of `path` and `lift`.
        path: (n, 3) of the probe, m. lift: (n, 3) of the support and of the tissue with it, m.
        gives: (3,) by how much a rig gives way more, m/N.
    """

    time: Float[np.ndarray, " n"]
    path: Float[np.ndarray, "n 3"]
    lift: Float[np.ndarray, "n 3"]
    gives: Float[np.ndarray, " 3"]

    @classmethod
    def of(cls, bench: "ProbingBench", at: Mapping[str, float], path: str, recording: str) -> "Motion":
        """Of the parameter at `path` in one recording."""
        name, effect = path.split(".")[2], bench.runs.effects[path.split(".")[1]]
        setup, own = bench.ready.setups[recording], effect_values(effect, at, recording)
        probe = setup.scene.pressed
        time, place = (np.asarray(x, float) for x in (probe.time, probe.position))

        def moved(value):
            scene = effect.scene(own | {name: value}, setup.test, setup.scene)
            now, support = scene.pressed, scene.support.displacement
            none = jnp.zeros(3)
            return (
                none if now.offset is None else now.offset,
                now.time,
                jnp.zeros((len(time), 3)) if support is None else support,
                none if now.compliance is None else now.compliance + none,
            )

        value = jnp.asarray(own[name], probe.time.dtype)
        slopes = jax.jvp(moved, (value,), (jnp.ones_like(value),))[1]
        aside, late, lift, gives = (np.asarray(x, float) for x in slopes)
        return cls(time, aside - np.gradient(place, time, axis=0) * late[:, None], lift, gives)

    @property
    def axes(self) -> str:
        """Along which it moves the probe towards the tissue or away."""
        along = np.abs(self.path - self.lift).max(0) + np.abs(self.gives)
        return "".join(axis for axis, size in zip("xyz", along) if size > 0)

    def towards(self, axis: int, time: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
        """Of the probe, seen from the support, m."""
        return np.interp(time, self.time, (self.path - self.lift)[:, axis])

    def carried(self, axis: int, time: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
        """Of the tissue with the support, m."""
        return np.interp(time, self.time, self.lift[:, axis])


def _axes(bench: "ProbingBench", at: Mapping[str, float], path: str, own: tuple[str, ...]) -> str:
    found = {axis for r in own for axis in Motion.of(bench, at, path, r).axes}
    return "".join(axis for axis in "xyz" if axis in found)


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
    p = effect_values(effect, values, name)
    out, test = {}, bench.ready.setups[name].test
    shown = channels["markers"].values.shape[1] if "markers" in channels else 0
    test = eqx.tree_at(lambda t: t.rest, test, test.rest[:shown])  # without the padding of the simulation
    for channel, ch in effect.channels(p, test, channels).items():
        t = np.asarray(measured[channel].time, float)
        flat = np.asarray(ch.values, float).reshape(len(t), -1)
        read = np.stack([np.interp(t, np.asarray(ch.time), flat[:, i]) for i in range(flat.shape[1])], axis=1)
        out[channel] = read.reshape(np.shape(ch.values))
    return out
