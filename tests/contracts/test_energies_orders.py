"""Second derivatives of every strain energy, forward over reverse and reverse over reverse; a third of the battery's
time, in a file of its own so that another worker takes it."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.energies import catalogue, stress
from tissuejax.tensors import Sym

CASES = catalogue.examples()


@pytest.mark.parametrize("case", CASES)
def test_both_orders_of_differentiation_agree(case):
    energy = CASES[case]
    p = {d.name: jnp.asarray(d.default) for d in energy.parameters}
    v = jnp.array([0.3, -0.5, 0.8, 0.4, 0.2, -0.6])

    def psi(p, c):
        return stress.energy_density(energy, None, p, None, Sym(*c))

    # Compiled for two calls: little time in the compiler is worth more than speed.
    @functools.partial(jax.jit, compiler_options={"xla_backend_optimization_level": "0"})
    def derivatives(p, c):
        slope = jax.grad(psi, 1)
        along = jax.grad(psi, 0)
        return (
            (jax.jvp(lambda c: slope(p, c), (c,), (v,))[1], jax.grad(lambda c: slope(p, c) @ v)(c)),
            (jax.jvp(lambda c: along(p, c), (c,), (v,))[1], jax.grad(lambda p: slope(p, c) @ v)(p)),
        )

    for C in ([1.3, 0.9, 0.9, 0.0, 0.0, 0.0], [1.2, 0.9, 1.05, 0.1, -0.15, 0.05]):
        for one, other in derivatives(p, jnp.array(C)):
            for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other)):
                assert np.isfinite(a).all()
                np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * (1 + float(jnp.max(jnp.abs(b)))))
