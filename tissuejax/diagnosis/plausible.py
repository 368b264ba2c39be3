"""Whether a fit has earned the names that it uses: a periodic load must be periodic, a form must not sit on its limit.

Sines of a free frequency, with a phase and a strength for every recording, bend to follow drift, relaxation or slip
about as well as those effects do. So a periodic load counts only where what it explains looks like one:

1. it explains more of each recording than a parabola in time, which has as many parameters;
2. it is steady: one strength through a recording explains most of what one in every part of it would;
3. where several recordings are long enough to show it, one strength explains most of what one in each would, and
   where one is too short it is not far stronger there: an arc of a slow sine fits any short recording.

All in whitened residuals, with the rest of the fit as it stands. Exponents of fibres or of an energy that rest on their
limit describe no law: the recordings then ask for something that is not there below some stretch.
"""

from functools import partial

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.misfit import Misfit
from tissuejax.diagnosis.refit import Refit

CYCLES = 2.5  # periods that a recording must hold to count
STEADY = 0.75  # share of what separate parts would explain
COMMON = 0.6  # share of what separate recordings would explain
PARTS = 4  # of a recording, none shorter than 1.25 periods
PERIODIC = "effects.periodic."


def doubts(bench: Bench, misfit: Misfit, r: Refit) -> tuple[str, ...]:
    """Reasons, in words, why the names in `r` are not to be believed; empty where they may be."""
    if bench.dear or not np.isfinite(r.chi2):
        return ()
    return on_limit(bench, r) + periodic(bench, misfit, r)


def on_limit(bench: Bench, r: Refit) -> tuple[str, ...]:
    """Exponents in `r` that have run away: as named the law is not to be believed, in another form it may be."""
    return tuple(
        f"{path} rests on its limit of {bench.free[path].upper:.3g}"
        for path in r.at_bound
        if bench.free[path].limited and abs(r.values[path]) > 0.99 * bench.free[path].upper
    )


def periodic(bench: Bench, misfit: Misfit, r: Refit) -> tuple[str, ...]:
    """What speaks against the periodic load in `r`."""
    values = r.all
    own = [p for p in values if p.startswith(PERIODIC)]
    if not own:
        return ()
    frequency = values[f"{PERIODIC}frequency"]
    off = {p: 0.0 for p in own if not p.endswith("frequency")}
    part = r.prediction - bench.predict({**values, **off})
    left = bench.y - r.prediction
    gained = smooth = together = apart = 0.0
    strengths, brief = [], []
    for s in bench.segments:
        time = s.time - s.time[0]
        if frequency * time[-1] < CYCLES:
            brief.append(s.recording)
            continue
        white = partial(misfit.white, s=s)
        scale = bench.sigma[s.rows]
        e, p = white((left + part)[s.rows] / scale), white(part[s.rows] / scale)
        gain = float(e @ e - (e - p) @ (e - p))
        angle = 2 * np.pi * frequency * time
        harmonics = 2 if f"{PERIODIC}sin2" in own or f"{PERIODIC}sin2.{s.recording}" in own else 1
        waves = [f(k * angle) for k in range(1, harmonics + 1) for f in (np.sin, np.cos)]
        waves = white(np.stack(waves, 1) / scale[:, None])
        trend = np.polynomial.legendre.legvander(2 * time / time[-1] - 1, 2 * harmonics)
        gained += gain
        smooth += explained(e, white(trend / scale[:, None]))
        one = white(1 / scale)[:, None]
        for rows in parts(len(time), frequency * time[-1]):
            rest = e[rows] @ e[rows] - explained(e[rows], one[rows])
            both = explained(e[rows], np.hstack([one[rows], waves[rows]])) - explained(e[rows], one[rows])
            after = (e - p)[rows]
            apart += max(both - waves.shape[1], 0.0)
            together += rest - (after @ after - explained(after, one[rows]))
        weight = float(np.sum(waves[:, :2] ** 2)) / 2
        strengths.append((np.sqrt(2 * p @ p / max(np.sum(waves**2), 1e-300)), weight))
    if not strengths:
        return (f"no recording holds {CYCLES:g} periods of {1 / frequency:.3g} s",)
    out = []
    if f"{PERIODIC}frequency" in r.at_bound:
        out.append("the frequency rests on a limit")
    if gained <= smooth:
        out.append("a parabola in time explains as much as the periodic load")
    if together < STEADY * apart:
        out.append(f"the oscillation is not steady: {together / apart:.0%} of what it explains part by part")
    a, w = (np.array(x) for x in zip(*strengths))
    if len(a) > 1 and (share := np.sum(w * a) ** 2 / (np.sum(w) * np.sum(w * a * a))) < COMMON:
        out.append(f"it differs between recordings: one strength explains {share:.0%}")
    for name in dict.fromkeys(brief):
        both = [f"{PERIODIC}{f}.{name}" for f in ("sin", "cos")]
        if all(p in r.values for p in both):
            there, error = np.hypot(*(values[p] for p in both)), max(r.std[p] for p in both)
            if there - 3 * error > 2 * np.sum(w * a) / np.sum(w):
                out.append(f"it is far stronger in {name}, which is too short to show it")
    return tuple(out)


def parts(n: int, cycles: float) -> list[slice]:
    """Equal parts of n samples that hold 1.25 periods each at least, at most PARTS."""
    count = int(np.clip(cycles / 1.25, 2, PARTS))
    edges = np.linspace(0, n, count + 1).astype(int)
    return [slice(a, b) for a, b in zip(edges, edges[1:])]


def explained(e: Float[np.ndarray, " n"], columns: Float[np.ndarray, "n k"]) -> float:
    """Sum of squares of e that a least-squares fit of the columns removes."""
    q, _ = np.linalg.qr(columns)
    return float(np.sum((q.T @ e) ** 2))
