"""What an energy sees of a deformation, against numpy's algebra of F."""

import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.energies.catalogue import energy
from tissuejax.energies.fibre import WithFibre
from tissuejax.energies.strain import Strain
from tissuejax.tensors import Sym


@pytest.fixture(params=range(4))
def deformed(request):
    """F, far from rest and with every shear, and the strain of it."""
    F = np.eye(3) + 0.3 * np.random.default_rng(request.param).normal(size=(3, 3))
    F *= np.sign(np.linalg.det(F))
    return F, Strain.of(Sym.from_matrix(jnp.asarray(F.T @ F)))


def isochoric(F):
    return F / np.cbrt(np.linalg.det(F))


def test_invariants_are_those_of_the_isochoric_part(deformed):
    F, strain = deformed
    C = isochoric(F).T @ isochoric(F)
    expected = np.linalg.det(F), np.trace(C), (np.trace(C) ** 2 - np.trace(C @ C)) / 2
    np.testing.assert_allclose([strain.J, strain.I1, strain.I2], expected, rtol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.6, 2.2, -1.1])
def test_a_fibre_s_stretch_is_that_of_the_vector_along_it(deformed, angle):
    F, strain = deformed
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    found = strain.fibre_stretch_squared(jnp.asarray(along[0]), jnp.asarray(along[1]))
    assert found == pytest.approx(np.sum((isochoric(F) @ along) ** 2))


def test_sums_of_powers_are_those_of_the_principal_stretches(deformed):
    F, strain = deformed
    stretches = np.linalg.svd(isochoric(F), compute_uv=False)
    for alpha, found in zip((-3.0, 1.3, 7.0), strain.power_sums((-3.0, 1.3, 7.0)), strict=True):
        assert found == pytest.approx(np.sum(stretches**alpha))


def test_dispersion_is_between_aligned_and_isotropic():
    """Gasser, Ogden and Holzapfel 2006, eq. 2.24: kappa in [0, 1/3]."""
    (kappa,) = [p for p in WithFibre(energy("neo-hookean")).parameters if p.name == "kappa"]
    assert (kappa.lower, kappa.upper) == (0.0, pytest.approx(1 / 3))
