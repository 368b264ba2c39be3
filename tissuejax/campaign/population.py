"""A population of specimens: its mean, the spread between specimens and between groups of them (animals, days).

Every specimen's own fit gives an estimate x_i with covariance S_i. In working coordinates (logarithms of what is
positive)

    x_i ~ N(m + a_g(i), B + S_i),    a_g ~ N(0, A),

so a specimen's true values and the effects of groups are integrated out in closed form. NUTS (numpyro, the extra
`bayes`) only moves the mean m and the two covariances; each draw is then given group effects from their normal
conditional distribution. A hierarchical fit in two stages, exact where each fit is quadratic. Beside it stand separate
fits (x_i alone) and the pooled one (all specimens alike). Gelman and Hill 2007, ch. 12.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import solve_triangular
from jax.scipy.stats import multivariate_normal
from jaxtyping import Array, Bool, Float, Int

from tissuejax.errors import InputError
from tissuejax.estimation.ending import Ending

WIDE = 2.0  # spreads beforehand: half-normal, this many standard deviations of the estimates


@dataclass(frozen=True)
class Estimates:
    """Separate fits.

    Attributes:
        samples, paths: names of the specimens (n) and of the parameters (p).
        values, covariance: estimates, SI.
        positive: parameters whose logarithm is taken as normal.
        groups: the group of every specimen, or none.
        units: of the parameters.
        suspect: of every specimen, why its own fit should not be used as it is, empty where it may be; or none.
        left_out: specimens whose fit is not among these.
    """

    samples: tuple[str, ...]
    paths: tuple[str, ...]
    values: Float[np.ndarray, "n p"]
    covariance: Float[np.ndarray, "n p p"]
    positive: Bool[np.ndarray, " p"]
    groups: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    suspect: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    @property
    def doubtful(self) -> dict[str, str]:
        """Specimens whose own fit should not be used as it is, and why."""
        return {name: why for name, why in zip(self.samples, self.suspect) if why}

    @property
    def labels(self) -> tuple[str, ...]:
        """Groups, each once, sorted."""
        return tuple(sorted(set(self.groups)))

    @property
    def group(self) -> Int[np.ndarray, " n"]:
        """Index of every specimen's group."""
        return np.array([self.labels.index(g) for g in self.groups] or [0] * len(self.samples))

    @property
    def working(self) -> tuple[Float[np.ndarray, "n p"], Float[np.ndarray, "n p p"]]:
        """x and S: logarithms, and covariances carried over to first order."""
        x = np.where(self.positive, np.log(np.where(self.positive, self.values, 1.0)), self.values)
        slope = np.where(self.positive, 1 / np.where(self.positive, self.values, 1.0), 1.0)
        return x, self.covariance * slope[:, :, None] * slope[:, None, :]

    def natural(self, x: Float[np.ndarray, "... p"]) -> Float[np.ndarray, "... p"]:
        """Parameters from working coordinates, SI."""
        return np.where(self.positive, np.exp(np.where(self.positive, x, 0.0)), x)


@dataclass(frozen=True)
class Population:
    """Draws from the posterior of a population, in working coordinates.

    Attributes:
        of: what it was fitted to.
        mean: (d, p).
        between: (d, p, p) covariance between specimens of one group.
        between_groups: (d, p, p), zero without groups.
        effects: (d, g, p) of the groups.
        divergences: transitions of NUTS that diverged.
        rhat: largest of all parameters.
    """

    of: Estimates
    mean: Float[np.ndarray, "d p"]
    between: Float[np.ndarray, "d p p"]
    between_groups: Float[np.ndarray, "d p p"]
    effects: Float[np.ndarray, "d g p"]
    divergences: int
    rhat: float

    def specimens(self) -> tuple[Float[np.ndarray, "n p"], Float[np.ndarray, "n p"]]:
        """Shrunken specimens: posterior mean and standard deviation of each, in working coordinates."""
        x, S = self.of.working
        centre = self.mean[:, None] + self.effects[:, self.of.group]
        gain = self.between[:, None] @ np.linalg.inv(self.between[:, None] + S)
        mean = centre + (gain @ (x - centre)[..., None])[..., 0]
        spread = np.einsum("dnij,djk->dnik", np.eye(x.shape[1]) - gain, self.between)
        own = np.einsum("dnii->dni", spread).mean(0)
        return mean.mean(0), np.sqrt(np.maximum(own, 0.0) + mean.var(0))

    def new(self, group: str | None = None, seed: int = 0) -> Float[np.ndarray, "d p"]:
        """Draws of the parameters of a specimen not seen, SI: of a known group, or of a new one.

        Raises:
            InputError: no such group.
        """
        rng = np.random.default_rng(seed)
        if group is None:
            at = self.mean + _drawn(rng, self.between_groups)
        elif group in self.of.labels:
            at = self.mean + self.effects[:, self.of.labels.index(group)]
        else:
            raise InputError(f"no group {group!r}; there are {', '.join(self.of.labels) or 'none'}")
        return self.of.natural(at + _drawn(rng, self.between))

    def record(self) -> dict:
        """For JSON: mean and spreads with 95 % intervals; spreads of logarithms are relative."""

        def quantiles(draws: np.ndarray) -> dict[str, dict[str, float | list[float]]]:
            return {
                path: {"median": float(np.median(d)), "95 %": np.quantile(d, [0.025, 0.975]).tolist()}
                for path, d in zip(self.of.paths, draws.T, strict=True)
            }

        sd = np.sqrt(np.einsum("dii->di", self.between))
        groups = np.sqrt(np.einsum("dii->di", self.between_groups))
        new = self.new()
        return {
            "specimens": len(self.of.samples),
            "suspect": self.of.doubtful,
            "left_out": list(self.of.left_out),
            "groups": list(self.of.labels),
            "logarithm": dict(zip(self.of.paths, self.of.positive.tolist(), strict=True)),
            "typical": quantiles(self.of.natural(self.mean)),
            "between_specimens": quantiles(sd),
            "between_groups": quantiles(groups) if self.of.groups else {},
            "new_specimen": quantiles(new),
            "pooled": {p: [float(v), float(s)] for p, v, s in zip(self.of.paths, *pooled(self.of), strict=True)},
            "divergences": self.divergences,
            "rhat": self.rhat,
        }


def estimates(rows: Mapping[str, dict], groups: Mapping[str, str] | None = None) -> Estimates:
    """Separate fits from records of fits (`Fit.record()`, the answers of a campaign); specimens whose fit did not
    converge, or has a parameter at a bound or without an error, are left out. Those that a campaign calls suspect
    ("suspect", reasons by kind) take part and are named.

    Raises:
        InputError: fewer than three usable fits of the same free parameters.
    """
    used = {
        name: r
        for name, r in rows.items()
        if r["status"] == Ending.CONVERGED
        and all(p["at_bound"] is None and p["std"] is not None for p in r["parameters"].values() if p["free"])
    }
    shapes = {tuple(r["correlation"]["paths"]) for r in used.values()}
    if len(used) < 3 or len(shapes) != 1:
        raise InputError(
            f"{len(used)} of {len(rows)} fits converged inside their bounds, of {len(shapes)} sets of free parameters: "
            "a population needs three or more of the same"
        )
    paths = shapes.pop()
    values = np.array([[r["parameters"][p]["value"] for p in paths] for r in used.values()])
    std = np.array([[r["parameters"][p]["std"] for p in paths] for r in used.values()])
    correlation = np.array([r["correlation"]["matrix"] for r in used.values()])
    covariance = correlation * std[:, :, None] * std[:, None, :]
    labels = tuple(groups[name] for name in used) if groups else ()
    units = tuple(next(iter(used.values()))["parameters"][p]["unit"] for p in paths)
    doubts = ([why for of_kind in r.get("suspect", {}).values() for why in of_kind] for r in used.values())
    suspect = tuple("; ".join(said) for said in doubts)
    left_out = tuple(name for name in rows if name not in used)
    return Estimates(
        tuple(used), paths, values, covariance, np.all(values > 0, axis=0), labels, units, suspect, left_out
    )


def pooled(of: Estimates) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """One set of parameters for all specimens, and its standard errors, SI: weighted by the fits' own precision."""
    weights = np.linalg.inv(of.covariance)
    covariance = np.linalg.inv(weights.sum(0))
    return covariance @ np.einsum("nij,nj->i", weights, of.values), np.sqrt(np.diag(covariance))


def population(
    of: Estimates, draws: int = 500, warmup: int = 500, chains: int = 2, seed: int = 0,
    seen: Sequence[bool] | None = None, runner: "Runner | None" = None,
) -> Population:  # fmt: skip
    """The hierarchical fit.

    Args:
        seen: specimens that take part, all by default: of the others nothing is known but the group.
        runner: a compiled sampler of data of this shape, to use again.

    Raises:
        InputError: numpyro is missing.
    """
    x, S = of.working
    taking = np.ones(len(x), bool) if seen is None else np.asarray(seen, bool)
    # one unit for all: parameters differ by orders of magnitude
    centre, size = x[taking].mean(0), np.maximum(x[taking].std(0, ddof=1), 1e-9)
    runner = runner or Runner(len(of.labels), draws, warmup, chains)
    drawn = runner((x - centre) / size, S / np.outer(size, size), of.group, taking, seed)
    scale = np.outer(size, size)
    return Population(
        of,
        centre + size * drawn["m"],
        scale * drawn["B"],
        scale * drawn["A"],
        size * drawn["a"],
        drawn["divergences"],
        drawn["rhat"],
    )


class Runner:
    """NUTS over the hyperparameters, compiled once for data of one shape."""

    def __init__(self, groups: int, draws: int = 500, warmup: int = 500, chains: int = 2):
        try:
            from numpyro.infer import MCMC, NUTS
        except ImportError as error:
            raise InputError(
                "a population needs the extra `bayes`: pip install 'tissuejax[bayes]' (numpyro)"
            ) from error
        self.effects = jax.jit(jax.vmap(partial(_effects_drawn, groups), (0, 0, 0, 0, None, None, None, None)))
        kernel = NUTS(_model(max(groups, 1), groups > 1), dense_mass=True, target_accept_prob=0.9)
        self.run = MCMC(
            kernel, num_warmup=warmup, num_samples=draws, num_chains=chains, chain_method="sequential",
            progress_bar=False, jit_model_args=True,
        )  # fmt: skip

    def __call__(self, x, S, group, seen, seed: int) -> dict:
        """Draws in the units given: m, B, A, a; divergences and R-hat."""
        from numpyro.diagnostics import split_gelman_rubin

        arguments = (jnp.asarray(x), jnp.asarray(S), jnp.asarray(group), jnp.asarray(seen, float))
        self.run.run(jax.random.key(seed), *arguments, extra_fields=("diverging",))
        draws = {k: np.asarray(v) for k, v in self.run.get_samples().items()}
        chains = self.run.get_samples(group_by_chain=True)
        rhat = max(float(np.nanmax(split_gelman_rubin(np.asarray(chains[k])))) for k in ("m", "b"))
        found = {"m": draws["m"], "B": _covariance(draws["b"], draws["Lb"])}
        n, p = draws["m"].shape
        found["A"] = _covariance(draws["s"], draws["La"]) if "s" in draws else np.zeros((n, p, p))
        found["a"] = np.zeros((n, 1, p))
        if "s" in draws:
            roots = [draws[sd][:, :, None] * draws[L] for sd, L in (("b", "Lb"), ("s", "La"))]
            keys = jax.random.split(jax.random.key(seed + 1), n)
            found["a"] = np.asarray(self.effects(keys, *map(jnp.asarray, (draws["m"], *roots)), *arguments))
        diverged = int(np.sum(np.asarray(self.run.get_extra_fields()["diverging"])))
        return found | {"divergences": diverged, "rhat": rhat}


def _model(groups: int, several: bool):
    import numpyro
    from numpyro import distributions as dist

    def root(sd: str, correlation: str, p: int):
        size = jnp.asarray(numpyro.sample(sd, dist.HalfNormal(WIDE).expand([p]).to_event(1)))
        if p == 1:
            return size[:, None] * numpyro.deterministic(correlation, jnp.ones((1, 1)))
        return size[:, None] * numpyro.sample(correlation, dist.LKJCholesky(p, 2.0))

    def model(x, S, group, seen):
        p = x.shape[1]
        m = numpyro.sample("m", dist.Normal(0.0, 5.0).expand([p]).to_event(1))
        between = root("b", "Lb", p)
        among = root("s", "La", p) if several else None
        numpyro.factor("data", log_likelihood(m, between, among, x, S, group, seen, groups))

    return model


def log_likelihood(m, between, among, x, S, group, seen, groups: int) -> Float[Array, ""]:
    """Of the estimates, true values and group effects integrated out.

    Args:
        m: (p), the mean.
        between, among: lower roots (p, p) of B and of A; no groups: None.
        x, S, group: estimates (n, p), their covariances (n, p, p), their groups (n).
        seen: (n) 1 for a specimen that takes part, 0 for one that does not.
        groups: how many.
    """
    covariance = between @ between.T + S + 1e-12 * jnp.eye(x.shape[1])
    alone = jnp.sum(seen * multivariate_normal.logpdf(x, m, covariance))
    if among is None:
        return alone
    # x_i of a group share a = among z, z ~ N(0, 1): completing the square in z leaves K and h
    K, h = _of_groups(m, between, among, x, S, group, seen, groups)
    return alone + 0.5 * jnp.sum(h * jnp.linalg.solve(K, h[..., None])[..., 0]) - 0.5 * jnp.linalg.slogdet(K)[1].sum()


def _of_groups(m, between, among, x, S, group, seen, groups: int):
    """Precision K (g, p, p) of each group's standardised effect z given the data, and K times its mean, h (g, p)."""
    p = x.shape[1]
    weight = seen[:, None, None] * jnp.linalg.inv(between @ between.T + S + 1e-12 * jnp.eye(p))
    pull = (weight @ (x - m)[..., None])[..., 0]
    K = jnp.eye(p) + among.T @ jax.ops.segment_sum(weight, group, groups) @ among
    return K, jax.ops.segment_sum(pull, group, groups) @ among


def _effects_drawn(groups: int, key, m, between, among, x, S, group, seen) -> Float[Array, "g p"]:
    """The effects of all groups for one draw of m, B and A: z ~ N(K^-1 h, K^-1), a = among z."""
    K, h = _of_groups(m, between, among, x, S, group, seen, groups)
    root = jnp.linalg.cholesky(K)
    normal = jax.random.normal(key, h.shape)
    own = solve_triangular(root, normal[..., None], trans=1, lower=True)
    return (jnp.linalg.solve(K, h[..., None]) + own)[..., 0] @ among.T


def _covariance(sd: np.ndarray, root: np.ndarray) -> np.ndarray:
    scaled = sd[:, :, None] * root
    return scaled @ scaled.transpose(0, 2, 1)


def _drawn(rng: np.random.Generator, covariance: Float[np.ndarray, "d p p"]) -> Float[np.ndarray, "d p"]:
    """One normal draw for each covariance; zero where that is zero."""
    w, v = np.linalg.eigh(covariance)
    z = rng.normal(size=w.shape)
    return np.einsum("dij,dj->di", v, np.sqrt(np.maximum(w, 0.0)) * z)
