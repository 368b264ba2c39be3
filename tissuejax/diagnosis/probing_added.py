"""What sensors of a probing add to what they report, a function of time alone (`Effect.added`): it needs no simulation.

A drift, an offset, a hum: whatever the tissue does, they are what they are. So runs are made without them
(`probing_runs`), and they are added to what was simulated, at the sensors' own times: nothing that smooths between two
runs smooths them, and their derivatives are exact.
"""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.probing_runs import FINE, Runs
from tissuejax.diagnosis.probing_series import picked
from tissuejax.effects.effect import Effect
from tissuejax.recordings.recording import Channel


def is_added(runs: Runs, path: str) -> bool:
    """Whether a parameter belongs to an effect that is added."""
    return path.startswith("effects.") and type(runs.effects[path.split(".")[1]]).added


def added(runs: Runs, values: Mapping[str, float]) -> Float[np.ndarray, " N"]:
    """What is added at `values`, a long vector in SI units."""
    out = np.zeros(len(runs.y))
    for name in dict.fromkeys(p.split(".")[1] for p in values if is_added(runs, p)):
        effect = runs.effects[name]
        for recording in runs.rows:
            p = effect_values(effect, values, recording)
            if any(p[a] != 0 for a in effect.amplitudes):
                _put(runs, recording, out, _reported(runs, effect, p, recording))
    return out


def slope(runs: Runs, values: Mapping[str, float], path: str) -> Float[np.ndarray, " N"]:
    """Derivative of it by the parameter at `path`, in forward mode."""
    effect, name = runs.effects[path.split(".")[1]], path.split(".")[2]
    out = np.zeros(len(runs.y))
    for recording in [r for r in runs.rows if r == path.rsplit(".", 1)[-1]] or runs.rows:
        p = effect_values(effect, values, recording)

        def told(x, p=p, recording=recording):
            return _reported(runs, effect, p | {name: x}, recording)

        _, change = jax.jvp(told, (jnp.asarray(p[name], float),), (jnp.ones(()),))
        _put(runs, recording, out, change)
    return out


def effect_values(effect: Effect, at: Mapping[str, float], recording: str) -> dict[str, float]:
    """An effect's parameters in one recording, neutral where nothing is said."""
    paths = {d.name: f"effects.{effect.name}.{d.name}" for d in effect.parameters}
    return {n: at.get(f"{p}.{recording}", at.get(p, effect.neutral[n])) for n, p in paths.items()}


def _reported(runs: Runs, effect: Effect, p: Mapping, recording: str) -> dict:
    """What an effect adds to channels that are nothing, by channel; at the sensors' own times."""
    ready = runs.ready[FINE]
    measured = ready.sample.recordings[recording].channels
    channels = {
        c: Channel(np.asarray(measured[c].time, float), np.zeros(np.shape(measured[c].values)), measured[c].unit)
        for c in dict.fromkeys(s.channel for s in runs.segments if s.recording == recording)
    }
    shown = effect.channels(p, ready.setups[recording].test, channels)
    return {c: shown[c].values for c in channels if shown[c] is not channels[c]}


def _put(runs: Runs, recording: str, out: Float[np.ndarray, " N"], told: Mapping) -> None:
    for s in runs.segments:
        if s.recording == recording and s.channel in told:
            out[s.rows] += picked(np.asarray(told[s.channel], float), s, runs.finite)
