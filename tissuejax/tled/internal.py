"""Internal forces of the tissue: gather, deformation gradient, stress as gradient of the energy, forces, assembly.

The stages are kept apart by optimisation barriers: XLA on CPU would otherwise copy strain and stress into each of the
24 force outputs and compute them again there (3 to 5 times slower). Barriers survive only if a program is compiled
with `simulate.COMPILER_OPTIONS`; without them the result is the same and slower. Large bodies are taken in blocks whose
intermediate results (1.2 kB an element) stay in a core's own cache: a fifth to a quarter faster.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from tissuejax.arrays import barrier
from tissuejax.elements.element import Forces, cofactor, determinant, parts
from tissuejax.energies.strain import Strain
from tissuejax.tensors import Sym
from tissuejax.tled import native
from tissuejax.tled.history import relax
from tissuejax.tled.scene import Scene, filled

LINE = 64  # elements are padded to whole vectors and cache lines: an odd number costs up to half as much again
BLOCK = 256  # elements at most that are taken together, in bodies of more than two such blocks


class Mesh(NamedTuple):
    """What is computed once a run from the stress-free shape.

    `cells` (k, E') and `reference` are padded with elements without volume; `mass` (N,) is lumped, kg. Of elements with
    averaged pressure the volume of a node and its mean stiffness.
    """

    cells: Int[Array, "k E"]
    reference: Any
    stiffness: Float[Array, " E"]
    mass: Float[Array, " N"]
    nodal_volume: Float[Array, " N"] | None
    nodal_stiffness: Float[Array, " N"] | None = None


class History(NamedTuple):
    """What the material remembers; None where the scene has no such memory."""

    relaxed: list | None
    greatest: Float[Array, " E"] | None
    drained: list | None = None


def mesh(scene: Scene) -> Mesh:
    """Reference quantities; differentiable in points, density and stiffness."""
    body, tissue = scene.body, scene.tissue
    count, k = body.cells.shape
    padding = padded(count) - count
    cells = jnp.concatenate([body.cells, jnp.broadcast_to(body.cells[-1:], (padding, k))]).T
    reference = body.element.reference(take(body.points.T, cells))
    present = (jnp.arange(count + padding) < count).astype(body.points.dtype)
    volume = reference.volume * present
    reference = reference._replace(volume=volume)
    stiffness = jnp.concatenate([scene.stiffness, jnp.zeros(padding, body.points.dtype)])
    shares = jnp.broadcast_to(volume / k, (k, len(volume)))
    nodal_volume = add(shares, cells, len(body.points))
    mass = tissue.density * nodal_volume
    if not body.element.averaged_pressure:
        return Mesh(cells, reference, stiffness, mass, None)
    mean = add(jnp.broadcast_to(volume * stiffness / k, (k, len(volume))), cells, len(body.points)) / nodal_volume
    return Mesh(cells, reference, stiffness, mass, nodal_volume, mean)


def blocks(count: int) -> int:
    """In how many blocks so many elements are taken: one where JAX computes elsewhere than on the CPU, whose caches
    blocks are for."""
    return -(-count // BLOCK) if count > 2 * BLOCK and jax.default_backend() == "cpu" else 1


def padded(count: int) -> int:
    """Elements with those added that fill whole blocks of whole lines."""
    n = blocks(count)
    return n * LINE * -(-count // (n * LINE))


def take(u: Float[Array, "... N"], cells: Int[Array, "k E"]) -> Float[Array, "... k E"]:
    """Nodal values by element, one component at a time: gathered together they would come out with the components
    fastest, and every later stage would read them with a stride (a tenth of a step)."""
    if u.ndim == 1:
        return u.at[cells].get(mode="promise_in_bounds")
    return jnp.stack(barrier(tuple(take(row, cells) for row in parts(u))))


def add(f: Float[Array, "k E"], cells: Int[Array, "k E"], count: int) -> Float[Array, " N"]:
    """Element contributions summed at the nodes: the transpose of `take`, one component at a time like it."""
    return jnp.zeros(count, f.dtype).at[cells].add(f, mode="promise_in_bounds")


def rest(scene: Scene, mesh: Mesh) -> History:
    """The memory of tissue that has been at rest for ever in its settled shape."""
    tissue, zero = scene.tissue, jnp.zeros_like(mesh.stiffness)
    relaxed = greatest = drained = None
    if tissue.prony is not None or tissue.damage is not None:
        u = settled(scene)
        F, _ = scene.body.element.gradient(mesh.reference, take(u, mesh.cells))
        psi, S = isochoric(scene, mesh, cauchy_green(F))
        relaxed = None if tissue.prony is None else [tuple(S) for _ in range(len(tissue.prony.g))]
        greatest = None if tissue.damage is None else jnp.maximum(zero, psi)
    if tissue.drain is not None:
        F, _ = scene.body.element.gradient(mesh.reference, take(settled(scene), mesh.cells))
        drained = [_volumetric_gradient(scene, mesh, cauchy_green(F)) for _ in range(len(tissue.drain.g))]
    return History(relaxed, greatest, drained)


def settled(scene: Scene) -> Float[Array, "3 N"]:
    """Displacement at time zero."""
    body = scene.body
    return jnp.zeros_like(body.points.T) if body.settled is None else body.settled.T


def cauchy_green(F) -> Sym:
    """C = F^T F."""
    a, b, c = (parts(column) for column in parts(F, 1))

    def dot(p, q):
        return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]

    return Sym(dot(a, a), dot(b, b), dot(c, c), dot(a, b), dot(a, c), dot(b, c))


def first_piola(F, S):
    """P = F S, (3, 3, E)."""
    xx, yy, zz, xy, xz, yz = S
    rows = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    columns = parts(F, 1)
    return jnp.stack(barrier(tuple(sum(columns[k] * rows[k][j] for k in range(3)) for j in range(3))), 1)


def _isochoric_energy(scene: Scene, strain: Strain):
    psi = scene.tissue.energy.isochoric(scene.tissue.energy_values, strain)
    for energy in scene.tissue.added:
        psi = psi + energy(strain)
    return psi


def energy_density(scene: Scene, C: Sym) -> Float[Array, " E"]:
    """Strain energy by element before the stiffness factor, without memory, Pa."""
    strain = Strain.of(C)
    volumetric = scene.tissue.volumetric
    return _isochoric_energy(scene, strain) + volumetric.energy(scene.tissue.volumetric_values, strain.J)


def second_piola(g: Sym) -> tuple:
    """S = 2 dPsi/dC from the derivative by the six components (off-diagonal ones stand for two)."""
    return (2 * g.xx, 2 * g.yy, 2 * g.zz, g.xy, g.xz, g.yz)


def isochoric(scene: Scene, mesh: Mesh, C: Sym):
    """Isochoric energy (E,) and second Piola-Kirchhoff stress (six arrays), no memory, stiffness factor included."""

    def total(C):
        psi = mesh.stiffness * _isochoric_energy(scene, Strain.of(C))
        return jnp.sum(psi), psi

    g, psi = jax.grad(total, has_aux=True)(C)
    return psi, second_piola(g)


def stress(scene: Scene, mesh: Mesh, C: Sym, history: History, step) -> tuple[tuple, History]:
    """Second Piola-Kirchhoff stress with memory, and the memory after `step` seconds of real time.

    For elements with averaged pressure the isochoric part only.
    """
    tissue, averaged = scene.tissue, scene.body.element.averaged_pressure
    if averaged:
        S = isochoric(scene, mesh, C)[1]
    else:
        S = second_piola(jax.grad(lambda C: jnp.sum(mesh.stiffness * energy_density(scene, C)))(C))
    if tissue.prony is None and tissue.damage is None and tissue.drain is None:
        return S, history
    S, C = barrier((S, C))  # memory is subtracted from exactly the stress without it: neutral to the last bit
    relaxed, greatest, drained = history
    lost = []
    if tissue.prony is not None or tissue.damage is not None:
        psi, instant = isochoric(scene, mesh, C)
        if tissue.damage is not None:
            bare = jnp.where(mesh.stiffness > 0, mesh.stiffness, 1.0)
            greatest = jnp.maximum(filled(greatest), psi)
            loss = tissue.damage.loss(greatest / bare, psi / bare)
            lost.append(tuple(loss * i for i in instant))
            instant = tuple(i - loss * i for i in instant)
        if tissue.prony is not None:
            relaxed, gone = relax(tissue.prony, filled(relaxed), instant, step)
            lost.append(gone)
    if tissue.drain is not None and not averaged:
        drained, gone = relax(tissue.drain, filled(drained), _volumetric_gradient(scene, mesh, C), step)
        lost.append(gone)
    for gone in barrier(lost):
        S = tuple(s - g for s, g in zip(S, gone, strict=True))
    return S, History(relaxed, greatest, drained)


def _volumetric_gradient(scene, mesh, C):
    tissue = scene.tissue

    def total(C):
        return jnp.sum(mesh.stiffness * tissue.volumetric.energy(tissue.volumetric_values, Strain.of(C).J))

    return second_piola(jax.grad(total)(C))


def averaged_pressure(scene: Scene, mesh: Mesh, F) -> tuple[Float[Array, " E"], Float[Array, " N"]]:
    """Element pressure U'(J) from nodally averaged volume ratios (Bonet & Burton 1998), Pa, and U at the nodes.

    J_a = sum V_e J_e / sum V_e over the elements around node a; an element takes the mean of U'(J_a) over its nodes, so
    the forces are the exact gradient of sum_a V_a U(J_a).
    """
    V = shares(mesh, F)
    pressure, U = nodal_pressure(scene, mesh, add(V, mesh.cells, len(mesh.mass)))
    return take(pressure, mesh.cells).mean(0), U


def shares(mesh: Mesh, F) -> Float[Array, "k E"]:
    """What each element gives its nodes of its present volume, m^3."""
    k, V = mesh.cells.shape[0], mesh.reference.volume * determinant(F)
    return jnp.broadcast_to(V / k, (k, V.shape[-1]))


def nodal_pressure(scene: Scene, mesh: Mesh, V: Float[Array, " N"]) -> tuple[Float[Array, " N"], Float[Array, " N"]]:
    """U'(J_a) and U(J_a), Pa, from the present volume at the nodes, m^3."""
    tissue, factor = scene.tissue, filled(mesh.nodal_stiffness)
    energy = lambda J: factor * tissue.volumetric.energy(tissue.volumetric_values, J)  # noqa: E731
    U, slope = jax.vjp(energy, V / filled(mesh.nodal_volume))
    return slope(jnp.ones_like(U))[0], U


def forces(scene: Scene, mesh: Mesh, u: Float[Array, "3 N"], history: History, step):
    """Internal forces (3, N), N, and the memory after `step` seconds of real time.

    Total Lagrangian: f_a = sum_e V_e P . B_a with P = F S (Lister 2012, 4.3.1).
    """
    averaged = scene.body.element.averaged_pressure
    loop = native.loop(by_element, scene, mesh, history, pressed=averaged)
    if loop is not None:
        fields = ()
        if averaged:
            V = native.volumes(volume_shares, scene, mesh)(u)
            fields = (nodal_pressure(scene, mesh, V)[0][None],)
        f, history = loop(u, step, *fields)
        return barrier(f), history
    rows, count = parts(u), blocks(len(mesh.stiffness))
    if count == 1 or averaged:
        fe, history = contributions(scene, mesh, rows, history, step)
        return barrier(jnp.stack(barrier(tuple(add(f, mesh.cells, len(mesh.mass)) for f in fe)))), history
    size = len(mesh.stiffness) // count

    def block(i, carried):
        def cut(a):
            return jax.lax.dynamic_slice_in_dim(a, i * size, size, a.ndim - 1)

        def put(whole, part):
            return jax.lax.dynamic_update_slice_in_dim(whole, part, i * size, whole.ndim - 1)

        f, history = carried
        *some, before = barrier(jax.tree.map(cut, (mesh.cells, mesh.reference, mesh.stiffness, history)))
        part = mesh._replace(cells=some[0], reference=some[1], stiffness=some[2])
        fe, after = contributions(scene, part, rows, before, step)
        f = barrier(tuple(g.at[part.cells].add(x, mode="promise_in_bounds") for g, x in zip(f, fe, strict=True)))
        return f, jax.tree.map(put, history, after)

    none = tuple(jnp.zeros(len(mesh.mass), u.dtype) for _ in rows)
    f, history = jax.lax.fori_loop(0, count, block, (none, history))
    return barrier(jnp.stack(f)), history


def contributions(scene: Scene, mesh: Mesh, u, history: History, step) -> tuple[Forces, History]:
    """What each element of `mesh` adds at its nodes, N; displacements and forces one array a component."""
    return by_element(
        scene, mesh, barrier(jnp.stack(barrier(tuple(take(row, mesh.cells) for row in u)))), history, step
    )


def volume_shares(scene: Scene, mesh: Mesh, ue: Float[Array, "3 k E"]) -> Float[Array, "k E"]:
    """`shares` of displacements by element."""
    return shares(mesh, scene.body.element.gradient(mesh.reference, ue)[0])


def by_element(
    scene: Scene, mesh: Mesh, ue: Float[Array, "3 k E"], history: History, step, pressure: Array | None = None
) -> tuple[Forces, History]:
    """`contributions` of displacements by element.

    Args:
        pressure: of elements with averaged pressure, at their nodes (k, E), Pa; worked out here where it is not given.
    """
    element = scene.body.element
    shear = scene.settings.hourglass * scene.tissue.energy.initial_shear_modulus(scene.tissue.energy_values)
    F, memory = barrier(element.gradient(mesh.reference, ue))
    C = barrier(cauchy_green(F))
    S, history = barrier(stress(scene, mesh, C, history, step))
    P = first_piola(F, S)
    if element.averaged_pressure:
        p = averaged_pressure(scene, mesh, F)[0] if pressure is None else pressure.mean(0)
        P = P + p * cofactor(F)
    P = barrier(P)
    return barrier(element.forces(mesh.reference, P, memory, shear * mesh.stiffness)), history


def internal_energy(scene: Scene, mesh: Mesh, u: Float[Array, "3 N"]):
    """Elastic energy without memory, J, the volume ratio of each element (E,), and the hourglass energy, J."""
    element = scene.body.element
    F, memory = element.gradient(mesh.reference, take(u, mesh.cells))
    shear = scene.settings.hourglass * scene.tissue.energy.initial_shear_modulus(scene.tissue.energy_values)
    hourglass = jnp.asarray(element.hourglass_energy(mesh.reference, memory, shear * mesh.stiffness), u.dtype)
    J = determinant(F)
    V = mesh.reference.volume
    if scene.body.element.averaged_pressure:
        psi = mesh.stiffness * _isochoric_energy(scene, Strain.of(cauchy_green(F)))
        U = averaged_pressure(scene, mesh, F)[1]
        return jnp.sum(V * psi) + jnp.sum(filled(mesh.nodal_volume) * U), J, hourglass
    return jnp.sum(V * mesh.stiffness * energy_density(scene, cauchy_green(F))), J, hourglass
