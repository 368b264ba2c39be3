"""Posteriors of material tests: Laplace with Pareto-smoothed importance weights, and NUTS with the Fisher mass matrix.

Both start from the optimum and the Fisher information there. Laplace is right where its k-hat is below 0.7 (Vehtari et
al. 2024, J. Mach. Learn. Res. 25); NUTS (Hoffman and Gelman 2014) needs no such luck. blackjax and arviz are the extra
`bayes`.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.fitting.result import Fit
from tissuejax.fitting.target import Target

RELIABLE = 0.7  # of k-hat
EVEN = 0.95  # effective share of the draws: above, the weights are all alike and a fit of their tail says nothing
ENOUGH = 100  # effective draws, below which the ends of a 95 % interval rest on two or three of them
CONVERGED = 1.01  # of R-hat
MISSING = "needs the extra `bayes`: pip install 'tissuejax[bayes]' (blackjax, arviz)"


@dataclass(frozen=True)
class Posterior:
    """Draws of the free parameters.

    Attributes:
        method: "laplace" or "nuts".
        paths: the parameters.
        draws: (chains, draws, p), SI, of equal weight.
        checks: "khat" and "ess_share" of Laplace; "rhat" and "ess" (worst of all parameters), "divergences" of NUTS.
        warnings: sentences.
    """

    method: str
    paths: tuple[str, ...]
    draws: Float[np.ndarray, "c n p"]
    checks: dict[str, float]
    warnings: tuple[str, ...]

    @property
    def flat(self) -> Float[np.ndarray, "n p"]:
        """All draws."""
        return self.draws.reshape(-1, len(self.paths))

    def interval(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Central intervals by path."""
        ends = np.quantile(self.flat, [(1 - level) / 2, (1 + level) / 2], axis=0)
        return {p: (float(a), float(b)) for p, a, b in zip(self.paths, *ends, strict=True)}

    def record(self) -> dict:
        """For result.json, without the draws."""
        mean, std, ends = self.flat.mean(0), self.flat.std(0), self.interval()
        return {
            "method": self.method,
            "parameters": {
                p: {"mean": float(m), "std": float(s), "95 %": list(ends[p])}
                for p, m, s in zip(self.paths, mean, std, strict=True)
            },
            "checks": self.checks,
            "warnings": list(self.warnings),
        }

    def arviz(self):
        """As arviz InferenceData, one variable a parameter.

        Raises:
            InputError: arviz is missing.
        """
        az = _arviz()
        return az.from_dict(
            posterior={p: self.draws[:, :, i] for i, p in enumerate(self.paths)}, attrs={"method": self.method}
        )


def target_of(found: Fit) -> Target:
    """The posterior of a fit, tempered like its standard errors are widened (on the mean over the parameters)."""
    inflation = found.uncertainty.inflation
    return Target(found.problem, 1.0 if inflation is None else max(1.0, float(np.mean(inflation))))


def laplace(target: Target, x: Float[np.ndarray, " p"], draws: int = 2000, seed: int = 0) -> Posterior:
    """A normal in the unbounded variables at the optimum x, its draws weighted to the posterior and resampled."""
    az, rng = _arviz(), np.random.default_rng(seed)
    centre, root = target.start(x), np.linalg.cholesky(_positive(target.covariance(x)))
    z = rng.normal(size=(draws, len(centre)))
    y = centre + z @ root.T
    log_p = np.asarray(target.many(y, target.data))
    log_p = np.where(np.isnan(log_p), -np.inf, log_p)  # where a law has no stress nothing is likely
    log_w, khat = az.psislw(log_p + 0.5 * np.sum(z**2, axis=1))
    weights = np.exp(np.asarray(log_w) - np.max(log_w))
    weights = np.where(np.isfinite(weights), weights, 0.0)
    kept = rng.choice(draws, size=draws, p=weights / weights.sum())
    khat, share = float(khat), float(weights.sum() ** 2 / (weights @ weights) / draws)
    said = ()
    if not khat < RELIABLE and share < EVEN:
        said = (f"Pareto k-hat is {khat:.2f}, above {RELIABLE}: the posterior is far from normal; use NUTS",)
    if share * draws < ENOUGH:
        said += (f"only {share * draws:.0f} of {draws} draws count: intervals are coarse; use NUTS, or more --draws",)
    return Posterior(
        "laplace", target.problem.free, target.parameters(y[kept])[None], {"khat": khat, "ess_share": share}, said
    )


def nuts(
    target: Target, x: Float[np.ndarray, " p"], draws: int = 500, chains: int = 4, warmup: int = 300, seed: int = 0
) -> Posterior:
    """NUTS in variables whitened by the Fisher information at x; warm-up adapts the step and what is left to scale."""
    y, divergent = nuts_draws(target, x, target.data, draws, chains, warmup, seed)
    x_draws = np.stack([target.parameters(chain) for chain in y])
    az = _arviz()
    named = az.convert_to_dataset({p: x_draws[:, :, i] for i, p in enumerate(target.problem.free)})
    rhat = float(max(np.asarray(v) for v in az.rhat(named).data_vars.values())) if chains > 1 else float("nan")
    ess = float(min(np.asarray(v) for v in az.ess(named).data_vars.values()))
    said = []
    if chains > 1 and not rhat < CONVERGED:
        said.append(f"R-hat is {rhat:.3f}, above {CONVERGED}: the chains do not agree; draw more")
    if divergent:
        said.append(f"{divergent} divergent transitions: some corner of the posterior was not explored")
    checks = {"rhat": rhat, "ess": ess, "divergences": float(divergent)}
    return Posterior("nuts", target.problem.free, x_draws, checks, tuple(said))


def nuts_draws(target: Target, x, data, draws: int, chains: int, warmup: int, seed: int, run=None):
    """(chains, draws, p) of y, and how many transitions diverged; `run` from `nuts_runner` saves compiling again."""
    centre, root = target.start(x), np.linalg.cholesky(_positive(target.covariance(x)))
    run = run or nuts_runner(target, draws, chains, warmup)
    z, divergent = run(jnp.asarray(centre), jnp.asarray(root), jnp.asarray(data), jax.random.key(seed))
    return centre + np.asarray(z) @ root.T, int(np.sum(np.asarray(divergent)))


def nuts_runner(target: Target, draws: int, chains: int, warmup: int):
    """The compiled sampler: (centre, root of the covariance, data, key) -> whitened draws, divergences."""
    try:
        import blackjax
    except ImportError as error:
        raise InputError(f"NUTS {MISSING}") from error

    def one(key, centre, root, data):
        def density(z):
            return target.density(centre + root @ z, data)

        first, second, third = jax.random.split(key, 3)
        start = 0.3 * jax.random.normal(first, centre.shape)
        adapt = blackjax.window_adaptation(blackjax.nuts, density, is_mass_matrix_diagonal=True)
        (state, parameters), _ = adapt.run(second, start, num_steps=warmup)
        kernel = blackjax.nuts(density, parameters["step_size"], parameters["inverse_mass_matrix"])

        def step(state, key):
            state, info = kernel.step(key, state)
            return state, (state.position, info.is_divergent)

        _, drawn = jax.lax.scan(step, state, jax.random.split(third, draws))
        return drawn

    @jax.jit
    def run(centre, root, data, key):
        return jax.vmap(one, in_axes=(0, None, None, None))(jax.random.split(key, chains), centre, root, data)

    return run


def _positive(covariance: np.ndarray) -> np.ndarray:
    """Symmetric, with the least eigenvalue lifted to rounding."""
    covariance = 0.5 * (covariance + covariance.T)
    return covariance + 1e-12 * np.trace(covariance) / len(covariance) * np.eye(len(covariance))


def _arviz():
    try:
        import arviz
    except ImportError as error:
        raise InputError(f"a posterior {MISSING}") from error
    return arviz
