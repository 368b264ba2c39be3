"""The element loop in C computes what JAX computes of the same lane, and so do its derivatives, whatever is in it."""

import dataclasses
import time

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import expit

from tests.cutting.slabs import cut
from tests.tled import cases
from tissuejax.mesh.columns import box
from tissuejax.mesh.facets import boundary
from tissuejax.tled import build, contact, faces, internal, native, step, surface
from tissuejax.tled.blade import Wedge
from tissuejax.tled.history import Damage, Prony
from tissuejax.tled.lanes import library, loop
from tissuejax.tled.lanes.walk import Untold
from tissuejax.tled.shapes import Punch, Sphere

pytestmark = pytest.mark.skipif(library.compiler() is None, reason="no C compiler here")


@pytest.fixture(autouse=True)
def asked_for(monkeypatch):
    """The loop in C is on."""
    monkeypatch.setattr(native, "wanted", lambda: True)


@pytest.fixture(scope="module")
def set_up():
    """A scene whose elements have memory, bent by a random displacement; forces by C and by XLA."""
    body = box((0.04, 0.04, 0.04), (4, 4, 4))
    scene = cases.plain(body, np.arange(2.0), order=2)
    wide = scene.body.cells.astype(jnp.int64)  # as meshes from elsewhere have them; the C reads 32 bits
    scene = scene.put({"tissue.prony": Prony(jnp.array([0.3]), jnp.array([0.5])), "body.cells": wide})
    rng = np.random.default_rng(4)
    u = jnp.asarray(1e-3 * rng.normal(size=(3, len(body.points))))

    def forces(x, u, by_c: bool):
        values = {k: x[i] * v for i, (k, v) in enumerate(scene.tissue.energy_values.items())}
        here = scene.put({"tissue.energy_values": values, "settings.hourglass": x[-1]})
        mesh = internal.mesh(here)
        rest = internal.rest(here, mesh)
        if by_c:
            f, history = native.loop(internal.by_element, here, mesh, rest)(u, 0.1)
        else:
            fe, history = internal.contributions(here, mesh, list(u), rest, 0.1)
            f = jnp.stack([internal.add(g, mesh.cells, len(mesh.mass)) for g in fe])
        return f, jnp.stack(history.relaxed[0])

    return forces, jnp.array([1.0, 1.2, 0.3]), u, jnp.asarray(rng.normal(size=u.shape))


def _pulled(forces, by_c, w):
    return lambda x, u: jnp.vdot(w, forces(x, u, by_c)[0]) + jnp.sum(forces(x, u, by_c)[1])


@pytest.mark.parametrize(
    "derived",
    [
        lambda f, w, by_c: lambda x, u: f(x, u, by_c),
        lambda f, w, by_c: lambda x, u: jax.jacfwd(lambda x: f(x, u, by_c))(x),
        pytest.param(
            lambda f, w, by_c: (
                lambda x, u: jax.vmap(jax.grad(_pulled(f, by_c, w), (0, 1)), (0, None))(jnp.stack([x, 1.1 * x]), u)
            ),
            marks=pytest.mark.slow,
        ),
    ],
    ids=["forces", "Jacobian", "batch of gradients"],
)
def test_what_c_computes_is_what_xla_computes(set_up, derived):
    forces, x, u, w = set_up
    ours, known = (jax.jit(derived(forces, w, by_c))(x, u) for by_c in (True, False))
    for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(known), strict=True):
        assert np.abs(b).max() > 0
        assert np.allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())


SIDES = Wedge(8e-3, 0.3, 2e-3, side=np.tile([1.0, 1.0, -1.0, -1.0], 4))  # of the facets on the tissue's either side


FORMS = {"ball": Sphere(4e-3), "flat punch": Punch(3e-3, 1e-3), "blade": SIDES}
PAIRS = [
    pytest.param(form, False, id=f"bare-{name}", marks=[pytest.mark.slow] * (name != "ball"))
    for name, form in FORMS.items()
]
PAIRS += [  # a third of a minute each, most of it the C compiler's
    pytest.param(form, True, id=f"friction and adhesion-{name}", marks=pytest.mark.slow) for name, form in FORMS.items()
]


@pytest.mark.parametrize(("form", "rough"), PAIRS)
def test_contact_in_c_is_contact_by_xla(monkeypatch, form, rough):
    """Forces, torque, what rubbing lost and the memory after two places of the probe, their tangents and gradients."""
    made = cases.plain(box((0.02, 0.02, 0.01), (4, 4, 2)), np.arange(2.0), order=1)
    points = np.asarray(made.body.points)
    facets = boundary(np.asarray(made.body.cells), "hexahedron").nodes
    facets = facets[(points[facets][..., 2] > 0.0099).all(1)]
    path = np.array([[-0.1, 0, 0.02], [-0.1, 0, 0.02]])  # far from the tissue; places are given below
    probe = build.probe(made, form, [0.0, 1.0], path, facets, penalty=2e6, softness=1e-4)
    if rough:
        more = dict(friction=jnp.array(0.3), adhesion=jnp.array(500.0), give=jnp.array(1e-8), reach=jnp.array(2e-4))
        probe = dataclasses.replace(probe, **more)
    probe = jax.tree.map(lambda x: jnp.asarray(x) if np.asarray(x).dtype.kind == "i" else jnp.asarray(x, float), probe)
    patch = contact.patch(eqx.tree_at(lambda s: s.probe, made, probe, is_leaf=lambda x: x is None))
    u = jnp.asarray(2e-4 * np.random.default_rng(3).normal(size=(3, len(points))))
    low = 0.0135 if isinstance(form, Sphere) else 0.0125

    def twice(u, penalty, x):
        here = dataclasses.replace(probe, penalty=penalty)
        first = contact.forces(here, patch, u, jnp.array([0.0, 0, low]), contact.untouched(probe))
        then = contact.forces(here, patch, u, jnp.stack([x, 0.0 * x, low - 1e-4 + 0.0 * x]), first.grip)
        return [leaf for leaf in jax.tree.leaves(then) if leaf is not None]

    def found(by_c):
        monkeypatch.setattr(native, "wanted", lambda: by_c)
        at, along = (u, probe.penalty, jnp.array(5e-4)), (jnp.ones_like(u), jnp.array(1e5), jnp.array(1.0))
        pulled = jax.grad(lambda *a: sum(jnp.sum(x**2) for x in twice(*a)), (0, 1, 2))
        return jax.jit(lambda *a: (jax.jvp(twice, a, along), pulled(*a)))(*at)

    ours, known = found(True), found(False)
    assert native.contact(contact.by_facet, probe, patch, contact.untouched(probe)) is None  # as just set
    for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(known), strict=True):
        assert np.allclose(a, b, rtol=0, atol=1e-11 * max(np.abs(b).max(), 1e-6))  # a ball has no torque
    assert np.abs(known[0][0][0]).max() > 1e-3


@pytest.mark.parametrize(
    "law", ["bilinear", *(pytest.param(n, marks=pytest.mark.slow) for n in ("trapezoidal", "exponential"))]
)
def test_faces_in_c_are_faces_by_xla(monkeypatch, law):
    """Forces, memory and losses after two openings, tangents and gradients; 20 faces, no multiple of a block's 16."""
    strength = 3000.0 * (1 + 0.01 * np.arange(20))  # of each face's own
    scene = cut(h=1e-3, length=0.02, name=law, strength=strength)
    scene = scene.put({"faces.values": {**scene.faces.values, "shape": jnp.array(0.4)}})  # a trapezoid's
    joint, machine = scene.faces, step.machine(scene)
    assert len(joint.minus) == 20
    rng = np.random.default_rng(5)
    apart = np.zeros((3, len(scene.body.points)))
    apart[1, np.unique(joint.plus)] = 4e-4
    u = jnp.asarray(apart + 1e-4 * rng.normal(size=apart.shape))

    def twice(u, energy):
        here = eqx.tree_at(lambda f: f.values["energy"], joint, energy)
        memory = faces.unopened(here)
        for opened in (0.6 * u, 0.7 * u + 5e-5 * jnp.sin(1e5 * u)):  # some points open further, some close
            acting = surface.forces(None, None, here, machine.seam, index, opened, None, None, memory)
            memory = acting.memory
        return surface.added(acting, jnp.zeros_like(u)), acting.lost, *memory

    index = surface.corners(None, joint, u.shape[1])

    def found(by_c):
        monkeypatch.setattr(native, "wanted", lambda: by_c)
        at = u, joint.values["energy"]
        pulled = jax.grad(lambda *a: jnp.sum(twice(*a)[0] ** 2) + jnp.sum(twice(*a)[1]), (0, 1))
        return jax.jit(lambda *a: (jax.jvp(twice, a, along), pulled(*a)))(*at)

    along = jnp.asarray(1e-4 * rng.normal(size=u.shape)), jnp.array(0.3)
    ours, known = found(True), found(False)
    assert native.faces(faces.by_face, joint, machine.seam, faces.unopened(joint)) is None  # as just set
    for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(known), strict=True):
        assert np.allclose(a, b, rtol=0, atol=1e-11 * np.abs(b).max())
    f, lost, *_ = (np.asarray(x) for x in known[0][0])
    assert np.abs(f).max() > 1e-5
    assert (lost > 0).any()
    assert (lost == 0).any()


def test_points_far_from_the_probe_cost_no_more_than_others():
    """Softness of a millimetre keeps every point within range of the exponential; with one of 5 um most are so far that
    it underflows, and a vector function that meets such a number goes through its vector one by one (twice as
    long, before the argument was kept within `FAINT`)."""
    made = cases.plain(box((0.02, 0.02, 0.01), (8, 8, 2)), np.arange(2.0), order=1).cast(jnp.float32)
    points = np.asarray(made.body.points)
    facets = boundary(np.asarray(made.body.cells), "hexahedron").nodes
    facets = facets[(points[facets][..., 2] > 0.0099).all(1)]
    path = np.array([[-0.1, 0, 0.02], [-0.1, 0, 0.02]])  # far from the tissue; places are given below
    probe = build.probe(made, Sphere(4e-3), [0.0, 1.0], path, facets, penalty=2e6, softness=1e-3)
    single = lambda x: jnp.asarray(x) if np.asarray(x).dtype.kind == "i" else jnp.asarray(x, jnp.float32)  # noqa: E731
    probe = jax.tree.map(single, probe)
    patch = contact.patch(eqx.tree_at(lambda s: s.probe, made, probe, is_leaf=lambda x: x is None))
    at, u = jnp.array([0.0, 0.0, 0.0135], jnp.float32), jnp.zeros((3, len(points)), jnp.float32)

    @jax.jit
    def again(softness):
        here = dataclasses.replace(probe, softness=softness)
        near = lambda _, force: contact.forces(here, patch, u, at + 0 * force, contact.untouched(here)).force  # noqa: E731
        return jax.lax.fori_loop(0, 2000, near, jnp.zeros(3, jnp.float32))

    spent = {}
    for _ in range(9):
        for softness in (1e-3, 5e-6):
            begun = time.process_time()
            again(jnp.asarray(softness, jnp.float32)).block_until_ready()
            spent.setdefault(softness, []).append(time.process_time() - begun)
    soft, hard = (min(s[1:]) for s in spent.values())
    assert hard < 1.5 * soft


@pytest.mark.parametrize("z", [-1e3, -40.1, -39.9, -1.0, 0.0, 2.0, 39.9, 1e3])
def test_softplus_and_its_slope(z):
    got, slope = jax.value_and_grad(contact.softplus)(z)
    assert float(got) == (pytest.approx(np.logaddexp(0, z), rel=1e-12) if z > -40 else 0)
    assert float(slope) == pytest.approx(expit(z) if z else float(slope), rel=1e-12, abs=1e-17)


def test_operations_without_a_form_in_c_are_left_to_jax():
    cells = jnp.asarray(np.random.default_rng(0).integers(0, 50, (4, 64)), jnp.int32)
    x, stiffness = jnp.linspace(0.1, 0.9, 50)[None], jnp.linspace(1.0, 2.0, 64)

    def lane(x, stiffness):
        return [stiffness * jax.lax.cumsum(jnp.tanh(x), 1), stiffness**2 * jnp.sum(x, (0, 1))]

    def told(x, stiffness):
        kernel = loop.trace(
            lane, 4, [loop.Slot("nodal", (1,)), loop.Slot("lane", ())], ["nodal", "lane"], x.dtype
        )  # fmt: skip
        return loop.loop_p.bind(cells, x, stiffness, kernel=kernel, batched=(False, False), count=50)

    f, s = jax.jit(told)(x, stiffness)
    by_hand = np.zeros(50)
    for e in range(64):
        np.add.at(by_hand, cells[:, e], stiffness[e] * np.cumsum(np.tanh(np.asarray(x[0])[cells[:, e]])))
    assert np.allclose(f[0], by_hand, rtol=1e-12)
    assert np.allclose(s, stiffness**2 * np.asarray(x[0])[np.asarray(cells)].sum(0), rtol=1e-12)


def test_a_number_for_each_lane_given_as_one_for_all_is_refused():
    """The sides of a blade's facets once were, and each facet was pushed to the first one's side."""

    def lane(x, side):
        return [side * jnp.sum(x, (0, 1))]

    slots = [loop.Slot("nodal", (3,)), loop.Slot("uniform", (16,))]
    with pytest.raises(Untold, match="one number a lane"):
        loop.trace(lane, 4, slots, ["lane"], jnp.float64)


@pytest.mark.parametrize(("chosen", "wanted"), [(None, True), ("off", False), ("on", True)])
def test_it_is_used_unless_it_is_switched_off(monkeypatch, chosen, wanted):
    monkeypatch.undo()
    monkeypatch.delenv(library.ENVIRONMENT, raising=False)
    if chosen is not None:
        monkeypatch.setenv(library.ENVIRONMENT, chosen)
    assert native.wanted() is wanted


class More(eqx.Module):
    """A further energy, amount (I1bar - 3)^2."""

    amount: jax.Array

    def __call__(self, strain):
        return self.amount * (strain.I1 - 3.0) ** 2


MEMORIES = {
    "prony": {"tissue.prony": Prony(jnp.zeros(2), jnp.array([0.3, 2.0]))},
    "drain": {"tissue.drain": Prony(jnp.zeros(1), jnp.array([0.3]))},
    "recoverable": {"tissue.damage": Damage(jnp.asarray(0.0), jnp.asarray(50.0), jnp.asarray(0.0), jnp.asarray(0.1))},
    "added": {"tissue.added": (More(jnp.asarray(0.0)),)},
}


@pytest.mark.parametrize("name", sorted(MEMORIES))
def test_a_memory_at_its_neutral_value_changes_no_bit_of_the_forces(name, rng):
    """No product is fused into a sum and nothing is reordered: what adds zero leaves the rest as it is."""
    scene = cases.plain(cases.bent(), np.arange(2.0), order=2)
    u = jnp.asarray(1e-3 * rng.normal(size=(3, len(scene.body.points))))

    def forces(scene):
        mesh = internal.mesh(scene)
        found = native.loop(internal.by_element, scene, mesh, internal.rest(scene, mesh))
        return found(u, 0.1)[0]

    assert np.array_equal(forces(scene), forces(scene.put(MEMORIES[name])))


def test_tets_with_averaged_pressure_are_the_same_in_c(monkeypatch):
    """Two loops with the pressure at the nodes between them; by XLA one gather and scatter of all of it."""
    body = cases.tets(box((0.04, 0.04, 0.04), (3, 3, 3)))
    scene = cases.plain(body, np.arange(2.0), order=2)
    assert scene.body.element.averaged_pressure
    rng = np.random.default_rng(5)
    u = jnp.asarray(1e-3 * rng.normal(size=(3, len(body.points))))
    w = jnp.asarray(rng.normal(size=u.shape))

    def pulled(x, u):
        values = {k: x * v for k, v in scene.tissue.energy_values.items()}
        here = scene.put({"tissue.energy_values": values, "tissue.volumetric_values": {"K": 3e4 * x}})
        mesh = internal.mesh(here)
        return jnp.vdot(w, internal.forces(here, mesh, u, internal.rest(here, mesh), 0.1)[0])

    found = {}
    for name, on in (("C", True), ("XLA", False)):
        monkeypatch.setattr(native, "wanted", lambda on=on: on)
        value, slopes = jax.jit(jax.value_and_grad(lambda x, u: pulled(x, u), (0, 1)))(jnp.asarray(1.2), u)
        along = jax.jit(lambda x, u: jax.jvp(pulled, (x, u), (jnp.asarray(1.0), w))[1])(jnp.asarray(1.2), u)
        found[name] = (value, *slopes, along)
    for by_c, by_xla in zip(found["C"], found["XLA"], strict=True):
        np.testing.assert_allclose(by_c, by_xla, rtol=1e-10, atol=1e-12 * float(jnp.max(jnp.abs(by_xla))))


def test_on_another_device_no_program_has_barriers(monkeypatch):
    """Compilers for a graphics card have no form for them under the options that keep them on the CPU."""
    scene = cases.plain(box((0.04, 0.04, 0.04), (3, 3, 3)), np.arange(2.0), order=2)
    monkeypatch.setattr(native, "wanted", lambda: False)

    def barriers():
        def force(u):
            return internal.forces(scene, internal.mesh(scene), u, internal.History(None, None), 0.1)[0]

        u = jnp.zeros((3, len(scene.body.points)))
        return str(jax.make_jaxpr(lambda u: jax.jvp(force, (u,), (u,)))(u)).count("optimization_barrier")

    assert barriers() > 5
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    assert barriers() == 0
