"""Integrals over the past, exact for histories that are linear between samples, without a loop over time."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

BLOCK = 32


def fading(time: Float[Array, " n"], s: Float[Array, "n k"], tau: Float[Array, ""]) -> Float[Array, "n k"]:
    """h(t) = integral of exp(-(t - u)/tau) ds(u) from the first sample on, exact for s linear between samples.

    The recurrence h_k = exp(-x) h_(k-1) + (1 - exp(-x))/x (s_k - s_(k-1)), x = dt/tau, is unrolled in two levels of
    triangular matrices (32 samples a block): no sequential loop, and no exponent is ever positive. h is 0 at the
    first sample: the past before it has faded. Repeated times add nothing.

    Args:
        time: sample times, s, not decreasing.
        s: the history, one column a quantity.
        tau: relaxation time, s.

    Source: Taylor, Pister and Goudreau 1970, Int. J. Numer. Meth. Eng. 2; Simo and Hughes 1998, eq. 10.3.11.
    """
    n, extra = len(time), -len(time) % BLOCK
    step = jnp.diff(time, prepend=time[:1])
    x = step / tau
    small = x < 1e-4  # there the series is exact to rounding and its derivative finite
    slope = jnp.where(small, 1 - x / 2 + x * x / 6, -jnp.expm1(-x) / jnp.where(small, 1.0, x))
    gain = slope[:, None] * jnp.diff(s, axis=0, prepend=s[:1])
    t = jnp.concatenate([time, jnp.repeat(time[-1:], extra)]).reshape(-1, BLOCK)
    gain = jnp.concatenate([gain, jnp.zeros((extra, s.shape[1]), s.dtype)]).reshape(-1, BLOCK, s.shape[1])

    inside = jnp.einsum("bij,bjk->bik", _decay(t, tau), gain)
    ends = t[:, -1]
    at_ends = _decay(ends, tau) @ inside[:, -1]
    before = jnp.concatenate([jnp.zeros_like(at_ends[:1]), at_ends[:-1]])
    since = t - jnp.concatenate([ends[:1], ends[:-1]])[:, None]
    since = since.at[0].set(0.0)  # nothing comes before the first block
    h = inside + jnp.exp(-since / tau)[..., None] * before[:, None]
    return h.reshape(-1, s.shape[1])[:n]


def running_peak(s: Float[Array, "n ..."]) -> Float[Array, "n ..."]:
    """Largest value so far, column by column.

    Differentiable as the sample at which it was reached (the latest of equal ones).
    """
    if s.ndim > 1:
        return jax.vmap(running_peak, -1, -1)(s)
    now = jax.lax.stop_gradient(s)
    reached = now >= jax.lax.cummax(now)
    return s[jax.lax.cummax(jnp.where(reached, jnp.arange(len(s)), 0))]


def _decay(t: Float[Array, "... m"], tau: Float[Array, ""]) -> Float[Array, "... m m"]:
    """Lower triangle of exp(-(t_i - t_j)/tau)."""
    gap = t[..., :, None] - t[..., None, :]
    lower = jnp.tril(jnp.ones(gap.shape[-2:], bool))
    return jnp.where(lower, jnp.exp(-jnp.where(lower, gap, 0.0) / tau), 0.0)
