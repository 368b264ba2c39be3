"""How well the fitted recordings determine what is predicted of the held-out ones.

A fit that is right may still predict badly: recordings along one axis hardly know how fibres stiffen along the other.
The standard errors of the parameters are carried through the prediction, to first order: with J the derivative of the
held-out prediction and C the covariance of the fitted parameters, the prediction's covariance is J C J^T (linear
propagation of errors). What a held-out recording has for itself (its offset, its phase) is fitted there and takes its
part away. To first order means: where the answer is many times the noise it says "unknown", not how much.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.judgement.carried import carried
from tissuejax.diagnosis.judgement.whitening import Whitening
from tissuejax.diagnosis.misfit import Misfit
from tissuejax.diagnosis.refit import Refit
from tissuejax.estimation.covariance import inflation

OPEN = 1.0  # standard error over noise from which a prediction counts as open: half of its misfit is not the model's


@dataclass(frozen=True)
class Foreseen:
    """What the fitted recordings leave open in one held-out recording.

    Attributes:
        std: root mean square of the prediction's standard error over the recording, in `unit`.
        over_noise: the same in units of the recording's noise.
        path: the parameter of which knowing the value would close most of it.
    """

    recording: str
    std: float
    unit: str
    over_noise: float
    path: str

    def sentence(self, r: Refit) -> str:
        """For the reader."""
        value, std = r.values[self.path], r.std[self.path]
        return (
            f"{self.recording} asks for what the fitted recordings hardly determine: its prediction is uncertain, to "
            f"first order, by about {self.over_noise:.2g} times the noise, most of it from {self.path} = {value:.3g} "
            f"+- {std:.2g}. A misfit of that size there says nothing against the model; fit such a recording too "
            "before predicting others like it"
        )

    def as_dict(self) -> dict:
        """For `result.json`."""
        return dataclasses.asdict(self)


def foreseen(bench: Bench, misfit: Misfit, r: Refit) -> list[Foreseen]:
    """For every held-out recording; empty where no standard errors are known."""
    if not bench.held_out:
        return []
    paths, half = _spread(bench, misfit, r)
    if not paths:
        return []
    whole = _moved(bench, misfit, r, (*paths, *r.own))
    out = []
    for name in bench.held_out:
        own = bench.mask((name,))
        sigma = bench.sigma[own]
        jac = whole[own] / sigma[:, None]
        moved = without(jac[:, : len(paths)], jac[:, len(paths) :]) @ half
        # knowing one parameter takes its row of C away (conditioning of a normal distribution)
        closed = np.sum((moved @ half.T) ** 2, axis=0) / np.sum(half**2, axis=1)
        over = float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))
        std = float(np.sqrt(np.mean(np.sum(moved**2, axis=1) * sigma**2)))
        unit = next(s.unit for s in bench.segments if s.recording == name)
        out.append(Foreseen(name, std, unit, over, paths[int(np.argmax(closed))]))
    return out


def prediction_std(bench: Bench, misfit: Misfit, r: Refit) -> Float[np.ndarray, " N"]:
    """Standard deviation of the noise-free prediction, sqrt(diag(J C J')), fitted and held out; 0 where none is known.

    Args:
        misfit: under which `r` was fitted.
    """
    paths, half = _spread(bench, misfit, r)
    if not paths:
        return np.zeros(len(bench.y))
    moved = _moved(bench, misfit, r, paths) @ half
    return np.sqrt(np.sum(moved**2, axis=1))


def _moved(bench: Bench, misfit: Misfit, r: Refit, paths: tuple[str, ...]) -> Float[np.ndarray, "N k"]:
    """Derivative of what is predicted, with what follows the measurements (`carried`) and takes its part."""
    jac = bench.jacobian(r.all, paths, (*bench.fitted, *bench.held_out))
    return jac - carried(misfit, jac) if isinstance(misfit, Whitening) else jac


def _spread(bench: Bench, misfit: Misfit, r: Refit) -> tuple[tuple[str, ...], Float[np.ndarray, "k k"]]:
    """Identified paths, and a matrix whose product with its transpose is the covariance of their estimates."""
    paths = tuple(p for p, s in r.std.items() if np.isfinite(s))
    if not paths:
        return (), np.zeros((0, 0))
    fitted = misfit.whiten(bench.jacobian(r.values, paths, bench.fitted), bench.fitted)
    size = np.linalg.norm(fitted, axis=0)
    moving = size > 0  # of fibres that nothing stretches yet, all that is known is a prior
    paths, fitted, size = tuple(np.array(paths, object)[moving]), fitted[:, moving], size[moving]
    if not paths:
        return (), np.zeros((0, 0))
    _, s, v = np.linalg.svd(fitted / size, full_matrices=False)
    return paths, (v.T / s) * np.sqrt(inflation(r.chi2, r.n, r.k, bench.estimated)[0]) / size[:, None]


def without(jac: Float[np.ndarray, "n k"], own: Float[np.ndarray, "n m"]) -> Float[np.ndarray, "n k"]:
    """`jac` less what parameters with the derivatives `own`, fitted to the same samples, take up of it."""
    if not own.shape[1]:
        return jac
    u, s, _ = np.linalg.svd(own, full_matrices=False)
    u = u[:, s > 1e-10 * s[0]] if s[0] > 0 else u[:, :0]
    return jac - u @ (u.T @ jac)
