"""A nonlinear Maxwell element: the faster it flows, the more it is loaded."""

from collections.abc import Mapping
from functools import partial
from typing import ClassVar

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Sizes
from tissuejax.effects.material_test import MaterialTest, Stress
from tissuejax.parameters import Parameter


class NonlinearViscosity(Effect):
    """S = S_e - g z, dz/dt = (S_e - z)/tau (1 + |S_e - z|^2/stress^2)^((exponent - 1)/2), z = 0 stress flowed away.

    One Maxwell element on the isochoric PK2 stress whose fluidity grows with its own load as a power law, as in the
    flow rule of Bergstrom and Boyce; exponent 1 is a Prony term with g and tau. The energy's moduli are instantaneous.
    z starts at the first sample's stress: rested tissue. Integrated by diffrax (Tsit5, adaptive, a step ends at every
    sample: the load has a corner there, and steps across it are two to three times as many and leave 1e-7, not 1e-9).

    Revealed by relaxation that is quicker from a larger strain, and by hysteresis nearly independent of rate.
    Blind: one ramp at constant rate; at one amplitude and rate it is a Prony series.
    Source: Bergstrom and Boyce 1998, J. Mech. Phys. Solids 46 (power-law flow), here with a linear foot.
    """

    name: ClassVar[str] = "nonlinear-viscosity"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous"})
    searches: ClassVar[bool] = True
    reveals: ClassVar[str] = "relaxation that is quicker from larger strain, hysteresis at every rate"
    blind: ClassVar[str] = "a single ramp at constant rate"
    words: ClassVar[tuple[str, ...]] = ("{g:%} of the stress flows, with {tau} at small load and faster from {stress}",)
    source: ClassVar[str] = "Bergstrom and Boyce 1998, eq. 22"
    order: ClassVar[int] = 2
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "rates"}
    amplitudes: ClassVar[tuple[str, ...]] = ("g",)
    times: ClassVar[tuple[str, ...]] = ("tau",)
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {"tau": (1.0, 10.0), "stress": (0.2,), "exponent": (3.0,)}

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        load = 0.6 * sizes.energy / sizes.strain  # a third of the largest stress
        grid = {"tau": (0.1 * sizes.recording, sizes.recording), "stress": (load,), "exponent": (3.0,)}
        free = ("g", "tau", "stress", "exponent")
        form = Form("load-dependent", free, grid, nominated=False, beside=("one time", "two times"))
        ranges = {"stress": (0.1 * load, 10 * load, load)}
        return Offer(cls(), (form,), "viscoelasticity", ranges=ranges, quickest=sizes.finest)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("g", "1", 0.0, lower=0.0, upper=1.0, scale=0.1, meaning="share that flows"),
            Parameter("tau", "s", 5.0, lower=1e-3, upper=1e6, meaning="relaxation time under small load"),
            Parameter("stress", "Pa", 200.0, lower=1e-3, upper=1e12, meaning="load at which flow quickens"),
            Parameter("exponent", "1", 3.0, lower=1.0, upper=20.0, meaning="power of flow in load"),
        )

    def memory(self, p: Mapping[str, Array], test: MaterialTest, state: Stress) -> Stress:
        s = state.stacked()
        flowed = flowed_away(s / p["stress"], jnp.asarray(test.elapsed), p["tau"], p["exponent"])
        return state.replaced(s - p["g"] * (flowed * p["stress"]))


@jax.custom_jvp
def flowed_away(
    scaled: Float[Array, "n 4"], elapsed: Float[Array, " n"], tau: Float[Array, ""], exponent: Float[Array, ""]
) -> Float[Array, "n 4"]:
    """Stress z/stress that has flowed away at every sample, from S_e/stress; see `NonlinearViscosity`.

    A loop that reverse mode can turn round takes twice as long as one that it can't, and most predictions are never
    differentiated: this is the plain one, and its derivatives are those of the other.

    Args:
        elapsed: time since the first sample, s; tau: of relaxation under small load, s.
    """
    return _integrated(diffrax.ForwardMode(), scaled, elapsed, tau, exponent)


@flowed_away.defjvp
def _derivative(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    return jax.jvp(partial(_integrated, diffrax.DirectAdjoint()), primals, tangents)


def _integrated(adjoint: diffrax.AbstractAdjoint, scaled: Array, elapsed: Array, tau: Array, exponent: Array) -> Array:
    n = len(elapsed)
    # Repeated times are set apart by a billionth of a step, so that interpolation is defined; those at the end
    # (padding) by the whole recording, where nothing is integrated.
    end = elapsed[-1]
    apart = 1e-9 * end / n
    padding = jnp.arange(n) > jnp.argmax(elapsed >= end)
    time = jnp.where(padding, 2.0 * end, elapsed) + jnp.arange(n) * apart
    end = jnp.max(jnp.where(padding, 0.0, time))
    rate = jnp.diff(scaled, axis=0) / jnp.diff(time)[:, None]
    norm = jnp.array([1.0, 1.0, 1.0, 2.0], scaled.dtype)  # the shear component counts twice in S : S

    def flow(t, z, _):
        # `diffrax.LinearInterpolation` finds the interval by halving, a loop that costs more than all the rest
        k = jnp.clip(jnp.searchsorted(time, t, method="compare_all") - 1, 0, n - 2)
        load = scaled[k] + rate[k] * (t - time[k]) - z
        return load / tau * (1 + load @ (norm * load)) ** ((exponent - 1) / 2)

    controller = diffrax.PIDController(rtol=1e-9, atol=1e-10)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(flow),
        diffrax.Tsit5(),
        time[0],
        end,
        None,
        scaled[0],
        saveat=diffrax.SaveAt(t0=True, steps=True),
        stepsize_controller=diffrax.ClipStepSizeController(controller, step_ts=time),
        adjoint=adjoint,
        max_steps=16384,
        throw=False,
    )
    assert solution.ts is not None  # `saveat` asks for both
    assert solution.ys is not None
    # Every sample ends a step, to rounding. Asked for samples, diffrax would check their times by a call back into
    # Python, and a program that does so can't be kept on disk.
    return solution.ys[jnp.searchsorted(solution.ts, jnp.minimum(time, end) - 0.5 * apart)]
