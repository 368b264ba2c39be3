"""What was before: integrals over the past, peaks, and a clock that is late."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def fading(time: Float[Array, " n"], s: Float[Array, "n k"], tau: Float[Array, ""]) -> Float[Array, "n k"]:
    """h(t) = integral of exp(-(t - u)/tau) ds(u) from the first sample on, exact for s linear between samples.

    The recurrence h_k = exp(-x) h_(k-1) + (1 - exp(-x))/x (s_k - s_(k-1)), x = dt/tau, is run as it stands: one
    compiled loop with a product and a sum a step (measured: 0.15 ms for 1,024 samples and three times, against
    0.9 ms for the same in triangular blocks, and a quarter of the time of its Jacobian). h is 0 at the first
    sample: the past before it has faded. Repeated times add nothing.

    Args:
        time: sample times, s, not decreasing.
        s: the history, one column a quantity.
        tau: relaxation time, s.

    Source: Taylor, Pister and Goudreau 1970, Int. J. Numer. Meth. Eng. 2; Simo and Hughes 1998, eq. 10.3.11.
    """
    x = jnp.diff(time, prepend=time[:1]) / tau
    small = x < 1e-4  # there the series is exact to rounding and its derivative finite
    slope = jnp.where(small, 1 - x / 2 + x * x / 6, -jnp.expm1(-x) / jnp.where(small, 1.0, x))
    gain = slope[:, None] * jnp.diff(s, axis=0, prepend=s[:1])

    def step(h: Array, now: tuple[Array, Array]) -> tuple[Array, Array]:
        decay, added = now
        h = decay * h + added
        return h, h

    return jax.lax.scan(step, jnp.zeros_like(s[0]), (jnp.exp(-x), gain))[1]


def running_peak(s: Float[Array, "n ..."]) -> Float[Array, "n ..."]:
    """Largest value so far, column by column.

    Differentiable as the sample at which it was reached (the latest of equal ones). Run as it stands: beside
    `jax.lax.cummax` half the time, and a quarter of it to compile.
    """

    def step(peak: Array, now: Array) -> tuple[Array, Array]:
        peak = jnp.where(now >= peak, now, peak)
        return peak, peak

    return jax.lax.scan(step, s[0], s)[1]


def dying(time: Float[Array, " n"], rate: Float[Array, ""]) -> Float[Array, " n"]:
    """(1 - exp(-rate t))/rate: time as a drift feels it that dies out (gathers pace, rate < 0); t itself at rate 0."""
    going = rate != 0
    return jnp.where(going, -jnp.expm1(-rate * time) / jnp.where(going, rate, 1.0), time)


def acceleration(time: Float[Array, " n"], x: Float[Array, "n ..."]) -> Float[Array, "n ..."]:
    """Second derivative of x by time at every sample, of the parabola through it and its neighbours; 0 at both ends
    and where times repeat."""
    step = jnp.diff(time)
    inside = (step[1:] > 0) & (step[:-1] > 0)
    shaped = (slice(None), *(None,) * (x.ndim - 1))
    rate = jnp.diff(x, axis=0) / jnp.where(step > 0, step, 1.0)[shaped]
    span = jnp.where(inside, 0.5 * (step[1:] + step[:-1]), 1.0)
    bent = jnp.where(inside[shaped], jnp.diff(rate, axis=0) / span[shaped], 0.0)
    return jnp.pad(bent, [(1, 1)] + [(0, 0)] * (x.ndim - 1))


def delayed(time: Float[Array, " n"], x: Float[Array, " n"], lag: Float[Array, ""]) -> Float[Array, " n"]:
    """x as it was `lag` before every sample; at rest before the first and after the last one.

    Between samples a cubic through both with the slope of the chord from one neighbour to the other, so that the
    derivative by the lag is continuous, at 0 too, where every sample lies on a corner of a broken line: to its left
    and its right a ramp that begins has different rates, and no fit finds a way from there. Beside a corner it
    overshoots by 2/27 of a sample's step. Repeated times are a jump.

    Args:
        time: sample times, s, not decreasing.
        x: one value a sample.
        lag: s, of either sign.

    Source: Catmull and Rom 1974, in Computer Aided Geometric Design (chords as slopes).
    """
    step = jnp.diff(time)
    inside = (step[1:] > 0) & (step[:-1] > 0)
    slope = jnp.pad(jnp.where(inside, x[2:] - x[:-2], 0.0) / jnp.where(inside, time[2:] - time[:-2], 1.0), 1)
    at = jnp.clip(time - lag, time[0], time[-1])
    k = jnp.clip(jnp.searchsorted(time, at, side="left"), 1, len(time) - 1)
    h = time[k] - time[k - 1]
    u = jnp.where(h > 0, (at - time[k - 1]) / jnp.where(h > 0, h, 1.0), 1.0)
    rise = x[k] - x[k - 1]
    bend = u * (1 - u) * ((1 - u) * (slope[k - 1] * h - rise) - u * (slope[k] * h - rise))
    return x[k - 1] + u * rise + bend
