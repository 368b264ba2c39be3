"""The posterior density of a fit's free parameters as one pure JAX function, for everything that samples.

    ln p(y | data) = -chi2(x(y)) / (2 c) + ln |dx/dy|

with x(y) the change of variable of `transforms.Box` (so no sample leaves the bounds), chi-square with its prior rows,
and c the widening of the fit's variances (misfit beyond the noise, correlated residuals), if above one. Parameters
without a prior have a flat one between their bounds. Noise levels are taken as known. Material tests only: a probing's
run takes seconds.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.errors import InputError
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.transforms import Box


class Target:
    """The posterior of a problem.

    Attributes:
        problem: what was fitted.
        data: measured values of all residuals, flat; an argument of the density, so that one compiled function serves
            many data sets of one shape.
        tempering: c above.
        density, many: (y, data) -> ln p of one and of many y, compiled.
        likelihoods: (x, data) -> `log_likelihood` of many x, compiled.
    """

    def __init__(self, problem: Problem, tempering: float = 1.0):
        """
        Raises:
            InputError: probings, or a robust loss (which is no likelihood).
        """
        if problem.predictor.name != "homogeneous":
            raise InputError("posteriors are for material tests; a probing has `profile` and its standard errors")
        if problem.loss != "squares":
            raise InputError(f"a posterior needs a likelihood; loss {problem.loss!r} is none: use squares")
        self.problem, self.tempering = problem, float(tempering)
        # Linear where there is no bound, also for moduli: a descent likes decades, a sampler a density near normal.
        b = problem.box
        self.box = Box(list(b.lower), list(b.upper), list(b.scale))
        self.data = problem.series.y
        self._sigma = problem.std
        self.density = jax.jit(self._density)
        self.many = jax.jit(jax.vmap(self._density, in_axes=(0, None)))
        self.likelihoods = jax.jit(jax.vmap(self.log_likelihood, in_axes=(0, None)))

    def with_data_of(self, problem: Problem) -> "Target":
        """The posterior of a problem that differs in its measured values only, without compiling again."""
        other = Target(problem, self.tempering)
        other.density, other.many, other.likelihoods = self.density, self.many, self.likelihoods
        return other

    def start(self, x: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """y of the parameters x."""
        return self.box.free(x)

    def parameters(self, y: Float[np.ndarray, "n p"]) -> Float[np.ndarray, "n p"]:
        """x of many y."""
        return np.array([self.box.bounded(row)[0] for row in np.atleast_2d(y)])

    def covariance(self, x: Float[np.ndarray, " p"]) -> Float[np.ndarray, "p p"]:
        """Of y at x: the inverse of the Fisher information there, times c."""
        _, J = self.problem.linearised(self.problem.values(x))
        slope = self.box.bounded(self.start(x))[1]
        _, s, vt = np.linalg.svd(J * slope, full_matrices=False)
        s = np.maximum(s, 1e-8 * s[0])
        return self.tempering * (vt.T / s**2) @ vt

    def _density(self, y: Float[Array, " p"], data: Float[Array, " n"]) -> Float[Array, ""]:
        x, log_slope = bounded(self.box, y)
        return self.log_likelihood(x, data) / self.tempering + jnp.sum(log_slope)

    def log_likelihood(self, x: Float[Array, " p"], data: Float[Array, " n"]) -> Float[Array, ""]:
        """-chi-square / 2, priors included; constants are left out."""
        problem = self.problem
        values = {p: jnp.asarray(float(v)) for p, v in problem.start.items()} | dict(zip(problem.free, x))
        recordings = problem.predictor.predict(values)
        predicted = jnp.concatenate(
            [jnp.ravel(recordings[r].channels[c].values)[problem.seen[r, c]] for r, c in problem.channels]
        )
        chi2 = jnp.sum(((predicted - data) / self._sigma) ** 2)
        for path, (mean, std) in problem.priors.items():
            chi2 = chi2 + ((values[path] - mean) / std) ** 2
        return -0.5 * chi2


def bounded(box: Box, y: Float[Array, " p"]) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
    """x(y) of `Box` and ln dx/dy, traced."""
    up, down = jax.nn.log_sigmoid(y), jax.nn.log_sigmoid(-y)
    x, slope = box.scale * y, jnp.log(box.scale) * jnp.ones_like(y)
    lower, upper = np.where(np.isfinite(box.lower), box.lower, 0.0), np.where(np.isfinite(box.upper), box.upper, 0.0)
    x = jnp.where(box.only_lower, lower + box.scale * jnp.logaddexp(0.0, y), x)
    x = jnp.where(box.only_upper, upper - box.scale * jnp.logaddexp(0.0, -y), x)
    x = jnp.where(box.both, lower + box.span * jnp.exp(up), x)
    slope = jnp.where(box.only_lower, jnp.log(box.scale) + up, slope)
    slope = jnp.where(box.only_upper, jnp.log(box.scale) + down, slope)
    return x, jnp.where(box.both, jnp.log(box.span) + up + down, slope)


Density = Callable[[Array, Array], Array]
