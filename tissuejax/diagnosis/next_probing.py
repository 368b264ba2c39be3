"""What to press next: the probing whose predicted outcomes differ most between the explanations that are left.

As for material tests (`next_experiment`), within what simulations cost: each planned press is run once for each
explanation, on the coarse mesh, and of what the wrong one could absorb only the stiffness scale is taken out (the
force grows with it, the markers hardly feel it). So the numbers rank protocols, and lean to the generous side.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.next_experiment import Proposal, called, shared
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_added import added
from tissuejax.diagnosis.probing_runs import COARSE, FINE, Runs
from tissuejax.diagnosis.probing_series import kept_samples, series
from tissuejax.diagnosis.refit import Refit
from tissuejax.errors import InputError
from tissuejax.experiments.probing_predictor import ProbingPredictor
from tissuejax.recordings.recording import Channel, Recording, Sample

DEEPER, FASTER, LONGEST = 1.25, 3.0, 12.0
NUMERICAL = {"force": 0.012, "markers": 0.02}  # share of the signal that mesh, step and penalty leave open


def presses(r: Recording, touch: float) -> dict[str, Recording]:
    """Variations of one recorded press, by what they are called.

    Args:
        touch: height of the probe's centre at first touch, m: depth is counted from there.
    """
    time, path = (np.asarray(r.inputs[f"probe/{k}"], float) for k in ("time", "position"))
    time = time - time[0]
    low = int(np.argmin(path[:, 2]))
    span, radius = float(time[-1]), float(r.attributes["probe/radius"])
    wait = min(span, LONGEST)
    deeper = path.copy()
    below = path[:, 2] < touch
    deeper[below, 2] = touch - DEEPER * (touch - path[below, 2])
    held = np.insert(path, low + 1, path[low], axis=0)
    held_time = np.insert(np.where(np.arange(len(time)) > low, time + wait, time), low + 1, time[low] + wait)
    drawn = np.insert(path, low + 1, [path[low] + [radius, 0, 0], path[low]], axis=0)
    drawn_time = np.where(np.arange(len(time)) > low, time + 4.0, time)
    drawn_time = np.insert(drawn_time, low + 1, [time[low] + 2.0, time[low] + 4.0])
    twice = np.concatenate([path, path[1:]])
    twice_time = np.concatenate([time, span + time[1:]])
    made = {
        f"the press of {r.name} held for {wait:.0f} s at its deepest": (held_time, held),
        f"the press of {r.name} {FASTER:.0f} times faster": (time / FASTER, path),
        f"the press of {r.name} a quarter deeper": (time, deeper),
        f"the press of {r.name} twice in a row": (twice_time, twice),
        f"the press of {r.name} drawn sideways by a radius at its deepest, and back": (drawn_time, drawn),
    }
    return {text: _planned(r, f"p{i}", t, p) for i, (text, (t, p)) in enumerate(made.items())}


def _planned(r: Recording, name: str, time: np.ndarray, path: np.ndarray) -> Recording:
    """A press to be made: sensors at their own rates, markers where they were, no force yet."""
    step = np.clip(np.diff(time), 1e-4, None)
    time = np.concatenate([[0.0], np.cumsum(step)])
    channels = {}
    for key, c in r.channels.items():
        rate = float(np.median(np.diff(np.asarray(c.time, float))))
        clock = np.arange(time[0] + rate, time[-1], max(rate, time[-1] / 200))
        first = np.asarray(c.values, float)[:1]
        values = np.repeat(first if key == "markers" else np.zeros_like(first), len(clock), axis=0)
        channels[key] = Channel(clock, values, c.unit, c.noise_std)
    inputs = {"probe/time": time, "probe/position": path}
    return replace(r, name=name, inputs=inputs, channels=channels)


def probing_proposals(
    sample: Sample, bench: ProbingBench, chosen: Refit, rival: Refit, most: int | None = 3
) -> list[Proposal]:
    """The presses that tell `chosen` from `rival` best, from those of `presses` for the first fitted recording."""
    name = bench.fitted[0]
    first = sample.recordings[name]
    time, path = (np.asarray(first.inputs[f"probe/{k}"], float) for k in ("time", "position"))
    touch = float(np.interp(float(bench.ready.setups[name].test.first_touch), time, path[:, 2]))
    words = presses(first, touch)
    planned = Sample(
        f"{sample.name} next", {r.name: r for r in words.values()}, sample.geometry, sample.density, sample.gravity
    )
    settings, pressed = bench.runs.ready[COARSE].settings, tuple(planned.recordings)
    try:
        ready = ProbingPredictor.prepare(bench.model, planned, pressed, settings)
    except InputError:  # a varied path that the body doesn't allow must not cost the verdict
        return []
    segments, y, sigma = series(planned, ready)
    runs = Runs({FINE: ready, COARSE: ready}, bench.runs.effects, segments, y, kept_samples(planned, segments))
    both = [bench.at(shared(r)) for r in (chosen, rival)]
    simulated = runs.many([(at, pressed, FINE) for at in both])
    predicted = [y + added(runs, at) for y, at in zip(simulated, both, strict=True)]
    names = [called(bench, r) for r in (chosen, rival)]
    out = []
    for text, r in words.items():
        own = [s for s in segments if s.recording == r.name]
        both = [told_apart(predicted, own, sigma, i) for i in (0, 1)]
        if np.all(np.isfinite(both)):
            out.append(Proposal(text, (names[0], names[1]), min(both), r))
    return sorted(out, key=lambda p: -p.discrimination)[:most]


def told_apart(
    predicted: list[Float[np.ndarray, " N"]], own: list, sigma: Float[np.ndarray, " N"], truth: int
) -> float:
    """Chi-square that would speak against the other explanation, its stiffness scale set free."""
    d, scale = [], []
    for s in own:
        a, b = predicted[truth][s.rows], predicted[1 - truth][s.rows]
        share = NUMERICAL[s.channel] * float(np.max(np.abs(a - a[0]), initial=0.0))
        noise = np.hypot(sigma[s.rows], share)
        d.append((a - b) / noise)
        scale.append(b / noise if s.channel == "force" else np.zeros_like(b))
    d, scale = np.concatenate(d), np.concatenate(scale)
    size = float(scale @ scale)
    left = d - scale * (float(scale @ d) / size if size > 0 else 0.0)
    return float(left @ left)
