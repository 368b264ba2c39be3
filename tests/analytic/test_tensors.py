"""Components of tensors against numpy's matrices, at many points at once."""

import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax import tensors
from tissuejax.tensors import Sym


@pytest.fixture
def pair(rng):
    a, b = rng.normal(size=(2, 40, 3, 3))
    return a + np.swapaxes(a, 1, 2), b + np.swapaxes(b, 1, 2)


def test_invariants_are_those_of_the_matrix(pair):
    a, b = pair
    s, t = Sym.from_matrix(jnp.asarray(a)), Sym.from_matrix(jnp.asarray(b))
    np.testing.assert_allclose(s.matrix(), a, rtol=1e-15)
    np.testing.assert_allclose(tensors.trace(s), np.trace(a, axis1=1, axis2=2), rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(tensors.trace_of_square(s), np.trace(a @ a, axis1=1, axis2=2), rtol=1e-13)
    np.testing.assert_allclose(tensors.double_dot(s, t), np.sum(a * b, axis=(1, 2)), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(tensors.determinant(s), np.linalg.det(a), rtol=1e-11, atol=1e-11)


def test_only_the_symmetric_part_of_a_matrix_is_taken(rng):
    F = rng.normal(size=(40, 3, 3))
    np.testing.assert_allclose(Sym.from_matrix(jnp.asarray(F)).matrix(), (F + np.swapaxes(F, 1, 2)) / 2, rtol=1e-15)
    C = tensors.right_cauchy_green(jnp.asarray(F)).matrix()
    np.testing.assert_allclose(C, np.einsum("nki,nkj->nij", F, F), rtol=1e-13, atol=1e-14)


def test_a_sum_begins_with_its_first_term():
    assert tensors.total([np.float32(0.1)]) == np.float32(0.1)
    assert tensors.total(iter([1.0, 2.0, 4.0])) == 7.0
    with pytest.raises(TypeError):
        tensors.total([])
