"""Is it the simulation and not the tissue? The prediction again with mesh, step and penalty changed.

From the change between two settings the distance of the better one to the limit follows by the order of convergence
(mesh: square of the spacing, step: the compression itself, since damping drags and lags in proportion to speed,
penalty: its inverse), so the cheap simulations tell of the errors of the dear one. If these three (each with an
amplitude of about one, together with the base's own parameters) take up the misfit, what the model lacks is resolution,
and no effect may be named.
"""

from dataclasses import dataclass

import numpy as np

from tissuejax.diagnosis.misfit import Misfit
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_runs import COARSE, FINE
from tissuejax.diagnosis.quality import TOLERATED
from tissuejax.diagnosis.refit import Refit
from tissuejax.diagnosis.score import complement, gain

MOSTLY = 0.6  # share of the misfit that has to be numerical before nothing else is looked for
MOST = 1.5  # of the estimated distance to the limit: farther off, it is no numerical error


@dataclass(frozen=True)
class Numerics:
    """What mesh, step and penalty leave open at one fit.

    Attributes:
        rms: root mean square over sigma of each choice's distance to its limit, by channel.
        gain: chi-square of the fitted recordings that the three take up, beside the base's parameters.
        held: the same of the held-out recordings, with the amplitudes of the fitted ones; negative if that goes wrong.
        share: of the excess.
        amplitudes: in units of the estimated distance to the limit.
    """

    rms: dict[str, dict[str, float]]
    gain: float
    held: float
    share: float
    amplitudes: dict[str, float]

    def enough(self, at: Refit) -> bool:
        """Whether the misfit of the base is a numerical error: nothing beyond it is left."""
        left = (at.chi2 - self.gain) / max(at.n - at.k - 3, 1)
        return self.share > MOSTLY and left < TOLERATED

    def as_dict(self) -> dict:
        """As in `result.json`."""
        return {
            "rms_over_sigma": self.rms,
            "chi2_explained": self.gain,
            "chi2_explained_held_out": self.held,
            "share_of_misfit": self.share,
            "amplitudes": self.amplitudes,
        }


def numerics(bench: ProbingBench, misfit: Misfit, at: Refit) -> Numerics:
    """The numerical error at a fit, from four cheap predictions and the derivatives by the base's parameters."""
    names, ready = bench.fitted, bench.runs.ready
    every = (*names, *bench.held_out)
    fine, rough = ready[FINE].settings, ready[COARSE].settings
    finer = fine.counts[0] / rough.counts[0]
    varied = {
        "mesh": (rough.changed(counts=fine.counts), 1 / (finer**2 - 1) if finer > 1 else 0.0),
        "step": (rough.changed(compression=fine.compression), 1 / (rough.compression / fine.compression - 1)),
        "penalty": (rough.changed(penalty=2 * rough.penalty), 2.0),
    }
    for choice, (settings, _) in varied.items():
        if choice not in ready:
            ready[choice] = ready[COARSE].with_settings(settings)
    told = bench.runs.many([(bench.at(at.all), every, kind) for kind in (COARSE, *varied)])
    changes = {c: remains * (p - told[0]) for (c, (_, remains)), p in zip(varied.items(), told[1:], strict=True)}
    rms: dict[str, dict[str, float]] = {}
    for choice, d in changes.items():
        for channel in dict.fromkeys(s.channel for s in bench.segments):
            z = np.concatenate([(d / bench.sigma)[s.rows] for s in misfit.rows(names) if s.channel == channel])
            rms.setdefault(choice, {})[channel] = float(np.sqrt(np.mean(z**2)))
    r = misfit.residual(at.prediction, names)
    excess = max(float(r @ r) - (at.n - at.k), 1.0)
    moved = np.stack(list(changes.values()), axis=1)
    moved = moved if np.all(np.isfinite(moved)) else np.zeros_like(moved)
    slopes = bench.jacobian(at.all, bench.base, every)
    basis, columns = complement(misfit.whiten(slopes, names)), misfit.whiten(moved, names)
    r, columns = (x - basis @ (basis.T @ x) for x in (r, columns))
    # whoever made the recordings may have been on the other side of the limit of mesh and penalty, but not of time
    least = [0.0 if choice == "step" else -MOST for choice in varied]
    taken, amplitudes = gain(r, columns, np.array(least), np.full(len(varied), MOST))
    held = 0.0
    if bench.held_out:  # the base's parameters give way there as they did in the fitted recordings
        given, *_ = np.linalg.lstsq(misfit.whiten(slopes, names), misfit.whiten(moved @ amplitudes, names), rcond=None)
        before = misfit.residual(at.prediction, bench.held_out)
        after = before - misfit.whiten(moved @ amplitudes - slopes @ given, bench.held_out)
        held = float(before @ before - after @ after)
    return Numerics(rms, taken, held, min(taken / excess, 1.0), dict(zip(changes, amplitudes.tolist())))
