"""Optional physics that is switched on, each against a closed form: adhesion, platens, capsule, bedding, gravity."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

from tests.tled import cases
from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import build, capsule, contact, native, statics, support
from tissuejax.tled.history import Prony
from tissuejax.tled.shapes import Platen
from tissuejax.tled.simulate import run

SIZE = (0.02, 0.016, 0.012)
AREA = SIZE[0] * SIZE[1]


def block(counts=(3, 2, 2)):
    """A box whose base glides: held along z, one corner in plan, a second one against turning; and what is held."""
    g = box(SIZE, counts)
    held = np.tile([0.0, 0.0, 1.0], (len(g.fixed), 1))
    base = np.asarray(g.points)[g.fixed]
    held[np.linalg.norm(base - base.min(0), axis=1).argmin()] = 1.0
    held[np.linalg.norm(base - [base[:, 0].max(), base[:, 1].min(), 0], axis=1).argmin(), 1] = 1.0
    return g, held


def under_platen(height, time, counts=(3, 2, 2), **options):
    """The block under a platen whose face follows `height` over `time`."""
    g, held = block(counts)
    path = np.stack([0 * height, 0 * height, height], 1)
    times = np.linspace(time[0], time[-1], 61)[1:]
    return build.scene(
        g,
        build.Tissue(ReducedPolynomial(order=2), Quadratic(), cases.POLY, cases.BULK, 1000.0),
        times,
        build.ProbePath(time, path, Platen()),
        numerics=cases.numerics(options),
        held=held,
        **options,
    )


def nominal(stretch: float, law: dict[str, float] = cases.POLY) -> float:
    """Uniaxial nominal stress with free sides: the energy minimised over the lateral stretch, differentiated, Pa."""

    def energy(x, z):
        J = x * x * z
        e = J ** (-2 / 3) * (2 * x * x + z * z) - 3
        return law["C10"] * e + law["C20"] * e * e + cases.BULK["K"] / 2 * (J - 1) ** 2

    def least(z):
        return minimize_scalar(lambda x: energy(x, z), bounds=(0.7, 1.5), method="bounded", options={"xatol": 1e-12})

    return (least(stretch + 1e-5).fun - least(stretch - 1e-5).fun) / 2e-5


@pytest.mark.parametrize("stretch", [0.9, 0.75])
def test_a_platen_compresses_a_gliding_block_homogeneously(stretch):
    """Force = area x nominal stress at the stretch that is left after the penetration, which follows the softplus."""
    time = np.array([0.0, 1.0])
    scene = under_platen(SIZE[2] * np.array([1.0, stretch]) + [1e-4, 0.0], time)
    found = statics.checked(statics.compiled(scene, 1.0, tolerance=1e-9, margin=3.0))
    top = np.asarray(scene.body.points)[:, 2] > SIZE[2] - 1e-9
    down = np.asarray(found.displacement)[top, 2]
    assert np.ptp(down) < 1e-8
    reached = 1 + down.mean() / SIZE[2]
    stress = nominal(reached)
    assert float(found.force[2]) == pytest.approx(-stress * AREA, rel=1e-6)
    depth = SIZE[2] * (reached - stretch)
    softness = float(scene.probe.softness)
    assert float(scene.probe.penalty) * softness * np.log1p(np.exp(depth / softness)) == pytest.approx(
        -stress, rel=1e-6
    )
    assert depth < 0.01 * (1 - stretch) * SIZE[2]  # the automatic penalty


def test_a_sticky_platen_pulls_with_its_strength_and_lets_go():
    """Pulled apart slowly, the greatest pull is strength x area (at a gap of `reach`), but for the 2 % of a point that
    was hardly touched; none before the first touch, none once the gap is five times `reach`, none without adhesion."""
    time = np.array([0.0, 0.3, 0.4, 1.4])
    height = SIZE[2] + np.array([3e-4, -1e-4, -1e-4, 14e-4])
    scene = under_platen(height, time, compression=2.0)
    sticky = scene.put({"probe.adhesion": jnp.asarray(40.0), "probe.reach": jnp.asarray(1.5e-4)})
    pull, bare = (-np.asarray(run(s).force)[:, 2] for s in (sticky, scene))
    t = np.asarray(scene.clock.middles)
    assert pull.max() == pytest.approx(0.98 * 40.0 * AREA, rel=0.02)
    assert np.abs(pull[t < 0.2]).max() < 1e-3 * 40 * AREA
    gap = np.interp(t, time, height) - SIZE[2]
    assert np.abs(pull[(t > 0.4) & (gap > 5 * 1.5e-4 + 1e-4)]).max() < 1e-3 * 40 * AREA
    assert bare.max() < 0.02 * pull.max()


@pytest.mark.parametrize("kind", ["hexes", "tets"])
def test_a_capsule_carries_the_tension_of_a_stretched_membrane(kind):
    """Plane-stress neo-Hookean: c (l1 - l1^-3 l2^-2) per width along 1, on the four faces that a cut across x meets;
    energy c/2 (l1^2 + l2^2 + (l1 l2)^-2 - 3) per area, on all six."""
    g = box(SIZE, (4, 3, 2))
    g = cases.tets(g) if kind == "tets" else g
    scene = cases.plain(g, np.arange(2.0))
    l1, l2, l3 = 1.2, 0.9, 1.1
    u = (jnp.asarray(g.points) * jnp.array([l1 - 1, l2 - 1, l3 - 1])).T
    c = 0.7
    skin = capsule.skin(scene.body)
    f = np.asarray(jax.jit(lambda u: capsule.forces(skin, c, u))(u))
    cut = np.asarray(g.points)[:, 0] > SIZE[0] / 2 - 1e-9
    along = 2 * SIZE[1] * c * (l1 - l1**-3 * l2**-2) + 2 * SIZE[2] * c * (l1 - l1**-3 * l3**-2)
    assert f[0, cut].sum() == pytest.approx(along, rel=1e-9)
    assert np.abs(f.sum(1)).max() < 1e-12
    kept = [(SIZE[i] * SIZE[j], a * a + b * b + (a * b) ** -2 - 3) for i, j, a, b in
            ((0, 1, l1, l2), (0, 2, l1, l3), (1, 2, l2, l3))]  # fmt: skip
    told = jax.jit(lambda u: capsule.energy(skin, c, u[:, skin.nodes]))(u)
    assert float(told) == pytest.approx(c * sum(area * w for area, w in kept), rel=1e-9)


@pytest.mark.parametrize("kind", ["hexes", "tets"])
def test_a_capsule_of_its_ballast_alone_stands_the_step(kind):
    """(omega h)^2 <= 4 of the membrane's own vibrations with half of the mass: the other half is for a squeezed sheet.
    The greatest is no less than the mean, by the trace 5 c A |grad N|^2 / 3 over m = 2 c A h^2 sum |grad N|^2: a
    quadrilateral's four nodes share it evenly, and a triangle's three."""
    g = cases.sheared(SIZE, (3, 2, 2))
    body = cases.plain(cases.tets(g) if kind == "tets" else g, np.arange(2.0)).body
    c, h = 0.7, 2e-4
    mass = np.repeat(np.asarray(capsule.ballast(body, c, h))[None], 3, 0).ravel()
    on = mass > 0
    slopes = jax.jit(jax.jacfwd(lambda u: capsule.forces(capsule.skin(body), c, u.reshape(3, -1)).ravel()))
    K = np.asarray(slopes(jnp.zeros(mass.size)))[np.ix_(on, on)]
    omega = np.sqrt(np.linalg.eigvalsh(K / np.sqrt(np.outer(mass[on], mass[on])))[-1])
    assert set(np.flatnonzero(on[: len(g.points)])) == set(np.asarray(body.facets).ravel())
    assert 5 / (24 if kind == "hexes" else 18) < (omega * h) ** 2 <= 2.0


def test_a_bedding_slips_by_its_law():
    """Pulled sideways by its own weight, the base slips by compliance x traction and creeps at fluidity x traction: the
    sum of area x slip is the law times the force on the support, whatever the distribution of the traction."""
    g = box((0.03, 0.03, 0.01), (4, 4, 3))
    pull, interval = 2.0, 0.01
    times = (np.arange(81) + 0.5) * interval  # a square: no frames beyond the last are run
    scene = cases.plain(g, times, gravity=(pull, 0, 0), mass_damping=120.0)
    elastic, fluid = 2e-6, 5e-7
    out = run(scene.put({"support.compliance": jnp.asarray(elastic), "support.fluidity": jnp.asarray(fluid)}))
    share = np.asarray(support.footprint(scene))
    felt = np.asarray(out.reaction)[:, 0]
    assert share.sum() == pytest.approx(0.03 * 0.03)
    assert felt[-1] == pytest.approx(1000.0 * 0.03 * 0.03 * 0.01 * pull, rel=0.01)
    slip = out.state.slip
    assert share @ np.asarray(slip.elastic)[0] == pytest.approx(elastic * felt[-1], rel=1e-3)
    assert share @ np.asarray(slip.viscous)[0] == pytest.approx(fluid * felt.sum() * interval, rel=5e-3)
    assert np.abs(share @ np.asarray(slip.viscous)[1]) < 1e-3 * fluid * felt.sum() * interval


def under_a_flat_face(kind, penalty=1e8, softness=1e-7):
    """A block that is held all round, a platen and the patch of its upper face."""
    g = box(SIZE, (3, 2, 2))
    g = cases.tets(g) if kind == "tets" else g
    rigid = Geometry(g.points, g.cells, g.cell_type, np.arange(len(g.points)))
    scene = cases.plain(rigid, np.arange(2.0))
    top = np.asarray(scene.body.facets)
    up = np.isclose(np.asarray(g.points)[top][:, :, 2], SIZE[2]).all(1)
    path = np.tile([0, 0, SIZE[2]], (2, 1))
    probe = build.probe(scene, Platen(), np.arange(2.0), path, top[up], penalty, softness)
    return scene, probe, contact.patch(scene.put({"probe": probe}))


@pytest.mark.parametrize("kind", ["hexes", "tets"])
def test_the_penalty_stores_the_integral_of_the_pressure_over_the_approach(kind):
    """p = penalty x softness x log(1 + exp z), z the depth over the softness, integrated by quadrature: from far off to
    deep inside. The pressure is cut off at z = -40, where exp(-40) of it is left."""
    scene, probe, patch = under_a_flat_face(kind, softness=2e-5)
    u = jnp.zeros_like(scene.body.points.T)
    stored = jax.jit(jax.vmap(lambda z: contact.energy(probe, patch, u, jnp.array([0.0, 0.0, SIZE[2]]) - 2e-5 * z)))
    z = np.array([-60.0, -8.0, -2.0, -0.5, 0.0, 0.3, 1.0, 4.0, 50.0])
    exact = np.array([quad(lambda s: np.logaddexp(0, s), min(end, 0) - 40, end, epsrel=1e-11)[0] for end in z])
    unit = 1e8 * 2e-5**2 * AREA
    error = np.asarray(stored(jnp.asarray(z)[:, None] * jnp.array([0.0, 0.0, 1.0]))) / unit - exact
    assert (np.abs(error) <= 1e-11 * exact + np.exp(-40)).all()


def test_the_energy_of_contact_is_the_integral_of_its_own_force(monkeypatch):
    """Work of the force over the way to each depth by Gauss's rule, twenty points to a softness, where all changes."""
    monkeypatch.setattr(native, "wanted", lambda: False)
    scene, probe, patch = under_a_flat_face("hexes", softness=2e-5)
    u, touched = jnp.zeros_like(scene.body.points.T), contact.untouched(probe)
    at = lambda z: jnp.array([0.0, 0.0, SIZE[2] - 2e-5 * z])  # noqa: E731
    push = jax.jit(jax.vmap(lambda z: contact.forces(probe, patch, u, at(z), touched).force[2]))
    place, weight = np.polynomial.legendre.leggauss(20)
    ends = np.arange(-40.0, 45.0)
    along = ends[:-1, None] + (place + 1) / 2
    work = 2e-5 * np.cumsum(np.asarray(push(along.ravel())).reshape(along.shape) @ weight / 2)
    stored = np.asarray(jax.jit(jax.vmap(lambda z: contact.energy(probe, patch, u, at(z))))(ends))
    assert np.allclose(stored[1:], work, rtol=1e-12, atol=0)  # the gap itself is known to 1e-13 softnesses
    assert abs(stored[0]) < 1e-12 * work[0]


@pytest.mark.parametrize(("kind", "rounding"), [(jnp.float64, 4e-16), (jnp.float32, 3e-7)], ids=["double", "single"])
def test_the_energy_of_contact_has_no_jump(kind, rounding):
    """At the gap of zero, where two forms of the integral meet in pi^2 / 12, and where the pressure is cut off."""
    tiny = float(jnp.finfo(kind).tiny)
    stored = np.asarray(contact.approached(jnp.asarray([-tiny, 0.0, tiny], kind)))
    assert np.allclose(stored, np.pi**2 / 12, rtol=rounding, atol=0)
    faint = np.asarray(contact.approached(jnp.asarray([-40.0, -40 + 1e-5], kind)), float)
    assert faint[0] == 0
    assert abs(faint[1]) < 1e-22
    slope = jax.vmap(jax.grad(contact.approached))(jnp.asarray([-30.0, -3.0, -0.1, 0.1, 3.0, 30.0], kind))
    assert np.allclose(slope, np.logaddexp(0, [-30.0, -3.0, -0.1, 0.1, 3.0, 30.0]), rtol=3 * rounding, atol=0)


@pytest.mark.parametrize("by_c", [True, False], ids=["c", "xla"])
@pytest.mark.parametrize("give", [0.0, 1.5e-8])
def test_friction_slides_at_its_limit_and_sticks_below(give, by_c, monkeypatch):
    """A platen pressed on and dragged across a block that is held all round: |drag| = mu x push once it slides, and the
    stiffness of the penalty's spring and of what gives, in series, times the way before. Both are even over the face:
    the torque is that of one force at its middle, the energy in the springs that of one spring."""
    if not by_c:
        monkeypatch.setattr(native, "wanted", lambda: False)
    scene, probe, patch = under_a_flat_face("hexes")
    probe = scene.put({"probe": probe}).put({"probe.friction": jnp.asarray(0.25)})
    probe = probe.put({"probe.give": jnp.asarray(give)}).probe
    u = jnp.zeros_like(scene.body.points.T)
    aside, middle = np.array([0.007, -0.004, SIZE[2]]), np.array([0.0, 0.0, SIZE[2]])
    above = jnp.asarray(aside + [0, 0, 1e-5])
    grip = contact.forces(probe, patch, u, above, contact.untouched(probe)).grip
    push = 1e8 * 1e-5 * AREA
    spring = 1 / (1e-8 + give)
    for way, drag in ((1e-6, 1e-6 * spring * AREA), (2.6 * (1e-6 + 100 * give), 0.25 * push)):
        at = aside + [way, 0, -1e-5]
        felt = contact.forces(probe, patch, u, jnp.asarray(at), grip)
        assert float(felt.force[2]) == pytest.approx(push, rel=1e-6)
        assert float(felt.force[0]) == pytest.approx(-drag, rel=1e-6)
        np.testing.assert_allclose(felt.torque, np.cross(middle - at, felt.force), rtol=1e-9)
        held = contact.gripped(probe, patch, u, jnp.asarray(at), grip)  # in the springs: force squared over 2 k
        assert float(held) == pytest.approx(drag**2 / (2 * spring * AREA), rel=1e-6)


def test_a_platen_off_centre_feels_the_torque_of_its_force():
    """Uniform pressure on a rectangle: the force acts at its centre, so torque = centre x force about the reference."""
    time = np.array([0.0, 0.4, 0.6])
    aside = np.array([0.007, -0.004, 0.0])
    scene = under_platen(SIZE[2] * np.array([1.0, 0.9, 0.9]), time, compression=2.0)
    out = run(scene.put({"probe.position": scene.probe.position + aside}))
    points = np.asarray(scene.body.points) + np.asarray(out.state.u).T
    top = np.asarray(scene.body.points)[:, 2] > SIZE[2] - 1e-9
    reference = aside + [0.0, 0.0, 0.9 * SIZE[2]]
    arm = 0.5 * (points[top].min(0) + points[top].max(0)) - reference
    assert np.abs(arm[:2]).max() > 0.1 * SIZE[0]
    force, torque = np.asarray(out.force)[-5:].mean(0), np.asarray(out.torque)[-5:].mean(0)
    assert force[2] > 0.01
    np.testing.assert_allclose(torque, np.cross(arm, force), rtol=0.01, atol=1e-3 * abs(force[2]) * SIZE[0])


@pytest.mark.parametrize("compression", [1.0, 3.0])
def test_relaxation_runs_on_the_recordings_clock(compression):
    """Pressed at once and held, the force falls to that of a softer law, and with tau: both clocks, however fast the
    simulated one runs."""
    g, tau = 0.4, 0.5
    time = np.array([0.0, 0.1, 0.2, 2.0])
    scene = under_platen(SIZE[2] * np.array([1.0, 1.0, 0.9, 0.9]), time, counts=(2, 2, 1), compression=compression)
    scene = scene.put({"tissue.prony": Prony(jnp.array([g]), jnp.array([tau]))})
    out = run(scene)
    force, t = np.asarray(out.force)[:, 2], np.asarray(scene.clock.middles)
    soft = {k: (1 - g) * v for k, v in cases.POLY.items()}
    end = -nominal(0.9, soft) * AREA
    held = (t > 0.3) & (t < 1.4)
    rate, start = np.polyfit(t[held] - 0.2, np.log(force[held] - end), 1)
    assert -1 / rate == pytest.approx(tau, rel=0.05)
    begun = -nominal(0.9) * AREA
    ramp = tau / 0.1 * (1 - np.exp(-0.1 / tau))  # a load raised evenly over 0.1 s has faded a little at its end
    assert np.exp(start) == pytest.approx((begun - end) * ramp, rel=0.05)
