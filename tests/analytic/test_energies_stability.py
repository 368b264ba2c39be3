"""Drucker stability against cases worked out by hand."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.energies import catalogue
from tissuejax.energies.published import PUBLISHED
from tissuejax.energies.stability import least_eigenvalue, log_strain_tangent, penalty, stability
from tissuejax.errors import InputError

quick = functools.partial(jax.jit, compiler_options={"xla_backend_optimization_level": "0"})  # compiled for one use
MOONEY = catalogue.energy("mooney-rivlin")


@pytest.mark.parametrize("name", PUBLISHED)
def test_at_rest_the_tangent_is_two_G(name):
    # W = G (e1^2 + e2^2 + (e1 + e2)^2): D = 2 G [[2, 1], [1, 2]], least eigenvalue 2 G.
    m = PUBLISHED[name]
    G = float(m.energy.initial_shear_modulus(m.constants))
    D = quick(lambda l: log_strain_tangent(m.energy, m.constants, "uniaxial", l))(jnp.ones(1))[0]
    np.testing.assert_allclose(D, 2 * G * np.array([[2, 1], [1, 2]]), rtol=1e-7)
    least = quick(lambda l: least_eigenvalue(m.energy, m.constants, "planar", l))(jnp.ones(1))
    assert least[0] == pytest.approx(2 * G, rel=1e-7)


def test_neo_hookean_is_stable_everywhere():
    found = stability(catalogue.energy("neo-hookean"), {"mu": 900.0}, (0.2, 5.0))
    assert found.stable
    assert found.paths["planar"].ranges == ((pytest.approx(0.2), pytest.approx(5.0)),)
    assert "is stable" in found.sentence


def test_mooney_rivlin_with_negative_C01_fails_where_algebra_says():
    # W = C10 sum l^2 + C01 sum l^-2; equibiaxial e1 = e2 = e, increments d(1, 1): D(1,1)/2 = 4 C10 (l^2 + 2 l^-4)
    # + 4 C01 (l^-2 + 2 l^4), increments (1, -1): 4 C10 l^2 + 4 C01 l^-2. The first vanishes at the root below.
    C10, C01 = 500.0, -50.0
    first = lambda l: C10 * (l**2 + 2 * l**-4.0) + C01 * (l**-2.0 + 2 * l**4)  # noqa: E731
    a, b = 1.0, 3.0
    for _ in range(60):
        a, b = (0.5 * (a + b), b) if first(0.5 * (a + b)) > 0 else (a, 0.5 * (a + b))
    found = stability(MOONEY, {"C10": C10, "C01": C01}, (0.9, 3.0), ("equibiaxial",))
    assert found.paths["equibiaxial"].unstable_above == pytest.approx(a, abs=2e-6)
    assert found.paths["equibiaxial"].unstable_below is None
    assert found.paths["equibiaxial"].ranges == ((pytest.approx(0.9), pytest.approx(a, abs=2e-6)),)
    # The other increment: C10 l^2 + C01 l^-2 = 0 at l = (0.1)^(1/4), in compression.
    found = stability(MOONEY, {"C10": C10, "C01": C01}, (0.4, 1.0), ("equibiaxial",))
    assert found.paths["equibiaxial"].unstable_below == pytest.approx(0.1**0.25, abs=2e-6)
    assert f"equibiaxial from {0.1**0.25:.3f} down" in found.sentence


def test_unstable_at_rest_is_said():
    found = stability(MOONEY, {"C10": -10.0, "C01": 1.0}, (0.8, 1.2), ("uniaxial",))
    assert not found.stable
    assert found.paths["uniaxial"].unstable_above == 1.0
    assert found.paths["uniaxial"].unstable_below == 1.0


def test_an_energy_that_ends_is_looked_at_inside_its_range():
    m = PUBLISHED["ex-vivo-log"]
    found = stability(m.energy, m.constants, (0.3, 3.0), ("uniaxial",)).paths["uniaxial"]
    assert 0.6 < found.stretch[0] < 0.62
    assert found.stable


def test_penalty_vanishes_where_stable_and_leads_back_to_stability():
    stretches = {"equibiaxial": jnp.linspace(1.0, 3.0, 21), "uniaxial": jnp.linspace(0.6, 2.0, 15)}
    with_slope = quick(jax.value_and_grad(lambda p: penalty(MOONEY, p, stretches)))
    assert with_slope({"C10": 500.0, "C01": 50.0})[0] == 0.0
    value, slope = with_slope({"C10": 500.0, "C01": -50.0})
    assert value > 0
    assert slope["C01"] < 0  # more C01 is more stable
    assert np.isfinite(list(slope.values())).all()


def test_wrong_ranges_are_refused():
    with pytest.raises(InputError, match="above 0"):
        stability(MOONEY, {"C10": 1.0, "C01": 1.0}, (-0.5, 1.0))
    with pytest.raises(InputError, match="Did you mean 'uniaxial'"):
        stability(MOONEY, {"C10": 1.0, "C01": 1.0}, (0.5, 1.0), ("uniaxal",))
