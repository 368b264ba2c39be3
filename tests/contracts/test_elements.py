"""Every element: shape functions, gradients of linear fields, forces without resultant, volume, faces, steepness."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax import elements
from tissuejax.elements.element import Element
from tissuejax.families import members
from tissuejax.mesh.facets import FACES

ELEMENTS = members(elements, Element)


@pytest.fixture(params=sorted(ELEMENTS))
def element(request):
    return ELEMENTS[request.param]()


@pytest.fixture
def bent(element, rng):
    """Three elements of that kind, bent out of shape: node positions (3, k, 3)."""
    corners = element.corners.T[:, :, None]
    return jnp.asarray(0.01 * (corners + 0.15 * rng.normal(size=(*corners.shape[:2], 3))))


def test_shape_functions_are_one_at_home_zero_elsewhere_and_sum_to_one(element, rng):
    assert np.allclose(element.shape(jnp.asarray(element.corners)), np.eye(element.nodes))
    assert np.allclose(element.shape(jnp.asarray(rng.uniform(size=(5, 3)))).sum(1), 1)


def test_a_linear_displacement_gives_its_own_gradient_and_no_hourglass(element, bent, rng):
    H = rng.normal(size=(3, 3))
    u = jnp.einsum("ij,jke->ike", H, bent) + rng.normal(size=(3, 1, 1))
    F, memory = element.gradient(element.reference(bent), u)
    assert np.allclose(F, (np.eye(3) + H)[:, :, None], atol=1e-12)
    assert np.allclose(element.hourglass_energy(element.reference(bent), memory, jnp.ones(3)), 0, atol=1e-20)
    f = element.forces(element.reference(bent), jnp.zeros((3, 3, 3)), memory, jnp.ones(3))
    assert np.allclose(jnp.stack(f), 0, atol=1e-13)


def test_forces_are_the_transpose_of_the_gradient_and_hourglass_energy_is_not_negative(element, bent, rng):
    """The power of the nodal forces equals V P : Fdot for a velocity without hourglass part."""
    reference = element.reference(bent)
    H, P = rng.normal(size=(2, 3, 3, 1))
    v = jnp.einsum("ij,jke->ike", H[..., 0], bent)
    _, memory = element.gradient(reference, jnp.zeros_like(bent))
    f = jnp.stack(element.forces(reference, jnp.broadcast_to(P, (3, 3, 3)), memory, jnp.ones(3)))
    assert np.allclose(jnp.sum(f * v, (0, 1)), reference.volume * np.sum(P * H), rtol=1e-10)
    w = 1e-5 * jnp.asarray(rng.normal(size=bent.shape))
    _, memory = element.gradient(reference, w)
    f = jnp.stack(element.forces(reference, jnp.zeros((3, 3, 3)), memory, jnp.ones(3)))
    assert (jnp.sum(f * w, (0, 1)) >= -1e-22).all()


def test_forces_have_no_resultant_and_no_moment_about_any_point(element, bent, rng):
    """Force balance for any stress; moment balance x cross f for a symmetric Cauchy stress (here F = 1)."""
    reference = element.reference(bent)
    _, memory = element.gradient(reference, 1e-7 * jnp.asarray(rng.normal(size=bent.shape)))
    S = rng.normal(size=(3, 3))
    P = jnp.broadcast_to((S + S.T)[:, :, None], (3, 3, 3))
    f = jnp.stack(element.forces(reference, P, memory, jnp.ones(3)))
    assert np.allclose(f.sum(1), 0, atol=1e-12)
    moment = np.cross(np.asarray(bent), np.asarray(f), axis=0).sum(1)
    assert np.allclose(moment, 0, atol=1e-12)


def test_volume_is_that_of_a_parallelepiped(element, rng):
    A = np.eye(3) + 0.2 * rng.normal(size=(3, 3))
    x = jnp.asarray(A @ element.corners.T)[:, :, None]
    unit = 8.0 if element.nodes == 8 else 1 / 6
    assert np.allclose(element.reference(x).volume, unit * np.linalg.det(A))


def test_faces_look_outwards_and_agree_with_the_mesh_room(element):
    assert element.faces == FACES[element.cells]
    centre = element.corners.mean(0)
    for face in element.faces:
        x = element.corners[list(face)]
        assert np.cross(x[1] - x[0], x[2] - x[0]) @ (x.mean(0) - centre) > 0


def test_steepness_is_the_largest_eigenvalue_of_the_gradients_and_grows_with_the_hourglass_stiffness(element, bent):
    """nodes * sum_a B_a B_a^T with V B_a read off from the forces of unit stresses."""
    reference = element.reference(bent)
    _, memory = element.gradient(reference, jnp.zeros_like(bent))
    B = []
    for J in range(3):
        P = jnp.zeros((3, 3, 3)).at[0, J].set(1.0)  # row x
        B.append(element.forces(reference, P, memory, jnp.ones(3))[0] / reference.volume)
    G = element.nodes * np.einsum("Ike,Jke->eIJ", B, B)
    assert np.allclose(element.steepness(reference, 0.0), np.linalg.eigvalsh(G)[:, -1])
    assert (element.steepness(reference, 5.0) >= element.steepness(reference, 0.0)).all()


def test_hourglass_forces_are_the_derivative_of_an_energy_that_rotation_leaves_alone(element, bent, rng):
    """Large deformation: f = dW/du with P = 0, and W(R(x + u)) = W(x + u)."""
    reference = element.reference(bent)
    u = 0.002 * jnp.asarray(rng.normal(size=bent.shape))

    def energy(u):
        _, memory = element.gradient(reference, u)
        return jnp.asarray(element.hourglass_energy(reference, memory, jnp.ones(3)))

    _, memory = element.gradient(reference, u)
    f = jnp.stack(element.forces(reference, jnp.zeros((3, 3, 3)), memory, jnp.ones(3)))
    assert np.allclose(f, jax.grad(energy)(u), rtol=1e-9, atol=1e-16)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turned = jnp.einsum("ij,jke->ike", R * np.sign(np.linalg.det(R)), bent + u) - bent
    assert np.allclose(energy(turned), energy(u), rtol=1e-10, atol=1e-20)
