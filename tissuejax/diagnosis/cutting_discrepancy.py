"""The discrepancy of cuts: what any model leaves of their forces.

Unlike that of material tests it is no function of the place that all strokes share: every stroke through fresh tissue
has a place of its own in the body, and what the tissue does there is its toughness. So what is smooth in place, of each
stroke's own and where it parts tissue, is the business of `toughness-map` and usual in size unless that is named; a
gain of each stroke's own (sites differ, so do zeroes of a depth), how the force sets in at the entry, what wanders in
time and what scatters may be strange without a name. Until the shoulder of a blade is in, all of its bevel works while
faces part ahead of it: the force passes a peak that a balance of energies has not.

| part | form, a share of |
|---|---|
| place, fine place | squared exponential in place (0.4 and 0.12 of the way) where fresh tissue is parted: prediction |
| gain | constant, of each stroke's own: prediction |
| onset | squared exponential in place (0.12) fading from the entry on, of each stroke's own: prediction |
| peak | falling off from one bevel behind the entry on, over a quarter of one, of each stroke's own: prediction |
| slow | exponential in time (0.05, 0.25 and 1.5 of the record), of each stroke's own: a share of the greatest force |
| white | what scatters from sample to sample beyond the stated noise: greatest force |
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.judgement.blocks import Blocks
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.estimation.discrepancy import Part, smooth_factor


@dataclass(frozen=True)
class CuttingDiscrepancy:
    """The parts; `shaped` (name, family, factors) scale with what is predicted, `fixed` don't."""

    shaped: tuple[tuple[str, str, Float[np.ndarray, "M r"]], ...]
    fixed: tuple[Part, ...]

    def about(self, prediction: Float[np.ndarray, " M"]) -> tuple[Part, ...]:
        """The parts beside this prediction; always in the same order."""
        return (*(Part(name, family, prediction[:, None] * f) for name, family, f in self.shaped), *self.fixed)


def cutting_discrepancy(
    bench: Bench,
    cut: Blocks,
    fresh: Mapping[str, Float[np.ndarray, " n"]],
    bevels: Mapping[str, float],
    criteria: Criteria | None = None,
) -> CuttingDiscrepancy:
    """The discrepancy of the strokes of a bench.

    Args:
        bevels: by recording, how long a bevel is along the way, m.
        fresh: by recording, the share of the motion that parts new tissue at each of its samples.
    """
    criteria = criteria or Criteria()
    smooth, strokes = criteria.smooth, criteria.strokes
    fine = smooth.law["fine law"]
    rows = [np.flatnonzero(cut.owner == k) for k in range(len(bench.segments))]
    place, parts = (
        cut.mean(np.concatenate([np.asarray(x, float) for x in series]))
        for series in ([s.drive for s in bench.segments], [fresh[s.recording] for s in bench.segments])
    )
    time, sigma = cut.mean(np.concatenate([s.time for s in bench.segments])), cut.spread(bench.sigma)
    grid = np.linspace(place.min(), place.max(), strokes.knots)

    def own(length: float, weight: Float[np.ndarray, " M"]) -> Float[np.ndarray, "M q"]:
        known = smooth_factor(grid[:, None], length)
        smooth = np.stack([np.interp(place, grid, f) for f in known.T], axis=1) * weight[:, None]
        return np.concatenate([np.where(np.isin(np.arange(len(place)), r)[:, None], smooth, 0.0) for r in rows], axis=1)

    shaped = [(name, "law", own(length, parts)) for name, length in (("place", strokes.place), ("fine place", fine))]
    belongs = (cut.owner[:, None] == np.arange(len(rows))).astype(float)
    shaped.append(("gain", "gain", belongs))
    shaped.append(("onset", "onset", own(fine, parts * np.exp(-np.maximum(place, 0.0) / strokes.entry))))
    bevel = np.array([bevels[s.recording] for s in bench.segments])[cut.owner]
    shaped.append(
        ("peak", "peak", belongs * (parts * np.exp(-np.maximum(place / bevel - 1, 0.0) / strokes.peak))[:, None])
    )
    peaks = [float(np.quantile(np.abs(bench.y[s.rows]), criteria.means.peak)) or 1.0 for s in bench.segments]
    fixed = []
    for name, share in smooth.slow.items():
        within = []
        for r, peak in zip(rows, peaks, strict=True):
            elapsed = time[r] / (float(np.ptp(time[r])) or 1.0)
            within.append((strokes.wander * peak) ** 2 * np.exp(-np.abs(elapsed[:, None] - elapsed) / share))
        fixed.append(Part(name, "slow", within=tuple(within)))
    scatter = [
        np.diag((peak * sigma[r] / max(float(np.median(sigma[r])), 1e-300)) ** 2)
        for r, peak in zip(rows, peaks, strict=True)
    ]
    return CuttingDiscrepancy(tuple(shaped), (*fixed, Part("white", "white", within=tuple(scatter))))
