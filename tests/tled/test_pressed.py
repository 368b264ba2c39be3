"""Contact is not passed through unsaid; step and penalty follow the pressed tissue; failures have their name."""

import warnings
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from tests.tled import cases
from tissuejax.energies.published import published
from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.errors import CoarseMesh, NotConverged, UnstableSimulation
from tissuejax.mesh.columns import box
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import build, gravity, pressed, statics, verdict
from tissuejax.tled.shapes import Hemisphere, Platen, Sphere
from tissuejax.tled.simulate import run

BALL = 0.004  # m
CUBE = box((0.02, 0.02, 0.02), (2, 2, 2))


def tissue(energy, values, K=20e3, geometry=CUBE, **options):
    times = options.pop("times", np.arange(2.0) * 1e-3)
    return build.scene(
        geometry,
        build.Tissue(energy, Quadratic(), values, dict(K=K), 1000.0),
        times,
        numerics=cases.numerics(options),
        **options,
    )


def test_stiffening_is_that_of_the_closed_form():
    """Ogden in ABAQUS's form: d sigma / d ln l = sum 2 mu_i (l^a_i + l^(-a_i/2) / 2), 3 sum mu_i at rest."""
    material = published("ex-vivo-ogden")
    mu, alpha = (np.array([material.constants[f"{k}{i}"] for i in (1, 2, 3, 4)]) for k in ("mu", "alpha"))
    scene = tissue(material.energy, material.constants)
    for stretch in (0.8, 0.65):
        slope = np.sum(2 * mu * (stretch**alpha + 0.5 * stretch ** (-alpha / 2)))
        assert pressed.stiffening(scene, stretch) == pytest.approx(slope / (3 * mu.sum()), rel=0.02)
    neo = tissue(ReducedPolynomial(order=1), cases.NEO)
    assert pressed.stiffening(neo, 0.5) == 1.0  # 2 l^2 + 1/l < 3


def test_waves_cross_a_squeezed_element_sooner():
    """K alone at constant volume: d2U/dF33^2 = K / l^2, so the step falls with l (the shear modulus is a hundredth)."""
    scene = tissue(ReducedPolynomial(order=1), dict(C10=50.0), K=20e3)
    assert pressed.quickening(scene, 0.5) == pytest.approx(2.0, rel=0.03)


LAYER = box((0.04, 0.04, 0.02), (8, 8, 4)).points


def lowered(radius, deep):
    """A path whose lowest point has the tip so deep in the layer."""
    return np.array([[0.0, 0.0, 0.02 + radius + up] for up in (0.01, -deep, 0.005)])


@pytest.mark.parametrize(("deep", "measured"), [(0.002, 0.69), (0.004, 0.53), (0.006, 0.35)])
def test_elements_under_a_ball_shorten_as_was_measured(deep, measured):
    """Neo-Hookean tissue, R 4.75 mm, 20 mm thick; a node that sticks out elsewhere makes the ball no deeper."""
    R = 0.00475
    humped = LAYER + [0.0, 0.0, 0.005] * (np.linalg.norm(LAYER[:, :2] - 0.01, axis=1) < 1e-9)[:, None]
    for points in (LAYER, humped):
        np.testing.assert_allclose(pressed.depth(points, Sphere(R), lowered(R, deep)), (deep, 0.02), rtol=1e-12)
        assert pressed.shortest_stretch(points, Sphere(R), lowered(R, deep)) == pytest.approx(measured, rel=0.08)


def test_a_layer_is_compressed_by_what_is_pressed_into_it():
    """To 1 - d/h as a whole, at worst 1.2 times as much in the logarithm: under a platen, and a ball wide against the
    layer. A ball adds 0.2 a/R with a^2 = 2 R d (Tabor), a <= R; deeper than its radius it squeezes little more."""
    flat, deep = Platen(), lowered(0.0, 0.005)
    assert pressed.shortest_stretch(LAYER, flat, deep) == pytest.approx(0.75**1.2)
    assert pressed.typical_stretch(LAYER, flat, deep) == pytest.approx(0.75)
    wide, deep = Sphere(0.05), lowered(0.05, 0.01)
    assert pressed.shortest_stretch(LAYER, wide, deep) == pytest.approx(0.5**1.2)
    assert pressed.typical_stretch(LAYER, wide, deep) == pytest.approx(0.5 * np.exp(-0.2 * np.sqrt(0.4)))
    small, deep = Sphere(0.002), lowered(0.002, 0.006)
    assert pressed.shortest_stretch(LAYER, small, deep) == pytest.approx(np.exp(-1.1))
    assert pressed.typical_stretch(LAYER, small, deep) == pytest.approx(0.7 * np.exp(-0.2))
    for shape, radius in ((flat, 0.0), (small, 0.002)):
        for stretch in (pressed.shortest_stretch, pressed.typical_stretch):
            assert stretch(LAYER, shape, lowered(radius, -0.001)) == 1.0  # does not touch


def test_elements_within_two_radii_of_the_path_may_be_squeezed():
    """In plan, wherever on its way the probe is; at least the nearest one, all of them under a platen."""
    g = box((0.04, 0.04, 0.02), (8, 8, 2))
    path = np.linspace([-0.0125, 0.0025, 0.03], [0.0025, 0.0025, 0.02], 40)  # over centres of elements, 5 mm apart

    def under(shape):
        found = np.asarray(g.points)[np.asarray(g.cells)[pressed.near(g.points, g.cells, shape, path)]].mean(1)
        return {(round(1e4 * x), round(1e4 * y)) for x, y, _ in found}

    row = {(x, 25) for x in (-125, -75, -25, 25)}
    assert under(Sphere(0.001)) == row
    assert under(Sphere(0.0026)) == row | {(-175, 25), (75, 25)} | {(x, y) for x, _ in row for y in (-25, 75)}
    assert len(under(Platen())) == 64
    path = path + [0.0, 0.1, 0.0]
    assert under(Sphere(0.001)) == {(x, 175) for x, _ in row}


def block(depth: float, shape=BALL, counts=(8, 8, 5), energy=None, values=None, **options):
    """A block of 24 x 24 x 10 mm, the ball pressed in by `depth` at 2 mm/s, run ten times as fast."""
    g = box((0.024, 0.024, 0.010), counts)
    end = depth / 0.002
    path = np.array([[0.0, 0.0, 0.010 + BALL], [0.0, 0.0, 0.010 + BALL - depth]])
    energy = ReducedPolynomial(order=1) if energy is None else energy
    options = dict(compression=10.0) | options
    return tissue(
        energy, cases.NEO if values is None else values, 15e3, g, times=(np.arange(25) + 0.5) * end / 25,
        probe_path=build.ProbePath(np.array([0.0, end]), path, shape), **options,
    )  # fmt: skip


def test_the_default_step_holds_where_a_third_of_the_thickness_is_pressed_in():
    scene = block(3.3e-3)
    at_rest = build.SAFETY * float(build.critical_steps(scene).min())
    assert float(scene.clock.step) < 0.8 * at_rest
    run(scene, halvings=0)


def test_a_run_that_breaks_down_is_tried_again_with_half_the_step():
    scene = block(3.3e-3)
    long = scene.put({"clock.steps": scene.clock.steps // 4})
    with pytest.raises(UnstableSimulation, match="Take a smaller step"):
        run(long, halvings=0)
    out = run(long, halvings=3)
    assert int(out.failed) == -1
    assert float(out.force[-1, 2]) == pytest.approx(float(run(scene).force[-1, 2]), rel=0.01)


def test_a_ball_that_sinks_through_the_surface_is_refused_with_time_place_and_remedy():
    scene = block(2e-3)
    run(scene)  # the automatic penalty is not refused
    soft = scene.put({"probe.penalty": 0.02 * scene.probe.penalty})
    with pytest.raises(
        UnstableSimulation, match=r"mm inside the probe at t = .* \(0.0, 0.0, .*\) mm: more than 5%"
    ) as told:
        run(soft)
    needed = float(str(told.value).split("larger penalty (")[1].split()[0])
    assert run(scene.put({"probe.penalty": needed})).depth < 0.03 * 0.004  # as the sentence says: 1 to 3 %


def stiffening(**options):
    """Ex vivo law, a hemisphere pressed to 45 % of the thickness."""
    material = published("ex-vivo-ogden")
    return block(4.5e-3, shape=Hemisphere(BALL), energy=material.energy, values=material.constants, **options)


def test_the_penalty_holds_where_the_law_stiffens_a_hundredfold():
    """The tissue at rest asks for a penalty that this press goes through (more than 5 % of the radius, from where on a
    run is refused); the automatic one follows the law and holds."""
    scene = stiffening()
    shear = float(scene.tissue.energy.initial_shear_modulus(scene.tissue.energy_values))
    grown = float(scene.probe.penalty) * 0.004 / build.YIELD / shear  # over that of the tissue at rest
    assert grown == pytest.approx(pressed.STIFFEST)
    run(scene)
    rest = {"probe.penalty": scene.probe.penalty / grown, "probe.softness": scene.probe.softness * grown}
    with pytest.raises(UnstableSimulation, match="inside the probe"):
        run(scene.put(rest | {"probe.mass": scene.probe.mass / grown}))


def test_elements_that_fold_under_the_ball_are_not_passed_over():
    """With little stiffness against bending the corner under the ball turns over, and the force is a quarter short of
    that of the same mesh with more."""
    stiff = stiffening(hourglass=3.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", CoarseMesh)
        whole = run(stiff)
    with pytest.warns(CoarseMesh, match=r"element \d+ near \(.*\) mm is folded by t = .*hourglass stiffness \(it was"):
        folded = run(stiffening())
    assert float(folded.corner) < 0 < float(whole.corner)
    assert float(folded.force[-1, 2]) < 0.85 * float(whole.force[-1, 2])


def test_the_corner_of_a_hex_is_folded_where_three_edges_change_sides():
    """By hand: node 6 of a unit cube is moved inwards along the diagonal. Its three edges -e_i gain (d, d, d); at its
    neighbours one edge is shorter by d."""
    cube = jnp.asarray(np.array(box((1.0, 1.0, 1.0), (1, 1, 1)).points))
    cells = box((1.0, 1.0, 1.0), (1, 1, 1)).cells[0]
    X = cube[cells].T[:, :, None]
    element = tissue(ReducedPolynomial(order=1), cases.NEO).body.element
    for d in (0.0, 0.2, 0.7):
        x = X.at[:, 6, 0].add(-d)
        own = float(np.linalg.det(d - np.eye(3)) / np.linalg.det(-np.eye(3)))
        assert float(element.least_corner(X, x)[0]) == pytest.approx(min(own, 1 - d), abs=1e-12)


@pytest.mark.slow
def test_the_force_never_falls_while_the_ball_goes_down():
    """In slow motion (4 mm/s, shear waves at rest 270 mm/s), at every frame. At 20 mm/s the soft surface
    bounces off a contact that is as stiff as the tissue will be in the end: frame means of the first half scatter."""
    force = np.asarray(run(stiffening(compression=2.0)).force)[:, 2]
    assert (np.diff(force) > 0).all()


@pytest.mark.slow
def test_a_breakdown_away_from_the_probe_is_put_down_to_gravity_or_the_support():
    """A tower of soft tissue under a hundredfold weight, pressed by nothing yet."""
    g = box((0.01, 0.01, 0.04), (2, 2, 8))
    path = np.array([[0.0, 0.0, 0.047], [0.0, 0.0, 0.046]])
    scene = tissue(
        ReducedPolynomial(order=1), cases.NEO, 15e3, g, times=(np.arange(20) + 0.5) * 0.01, gravity=(0, 0, -981.0),
        probe_path=build.ProbePath(np.array([0.0, 0.2]), path, 0.005),
    )  # fmt: skip
    with pytest.raises(UnstableSimulation, match="gravity or the support breaks it. The weight of the tissue's height"):
        run(scene)


@pytest.mark.parametrize(("deep", "lower", "said"), [(0.009, 0.0, True), (0.001, 0.0, False), (0.001, 0.008, True)])
def test_a_breakdown_below_the_surface_is_the_probes_where_its_tip_has_come_near(deep, lower, said):
    """A ball of 3 mm on tissue with weight; an element 7.5 mm below the surface, two and a half radii, breaks down.

    Pressed 9 mm the tip has gone past it; pressed 1 mm it has not come within two radii, unless it stands 8 mm lower.
    """
    g, radius, top = box((0.02, 0.02, 0.02), (4, 4, 4)), 0.003, 0.02
    path = np.array([[0.0, 0.0, top + radius + 1e-3], [0.0, 0.0, top + radius - deep]])
    scene = tissue(
        ReducedPolynomial(order=1), cases.NEO, 15e3, g, times=(np.arange(20) + 0.5) * 0.05, gravity=(0, 0, -9.81),
        probe_path=build.ProbePath(np.array([0.0, 1.0]), path, radius),
    )  # fmt: skip
    scene = scene.put({"probe.offset": jnp.array([0.0, 0.0, -lower])}) if lower else scene
    centres = np.asarray(g.points)[np.asarray(g.cells)].mean(1)
    below = int(np.linalg.norm(centres - [0.0025, 0.0025, 0.0125], axis=1).argmin())
    out = SimpleNamespace(element=below, failed=1, end_time=np.array([0.5, 1.0]))
    assert verdict._under_probe(out, scene) == said
    assert verdict.shorter_helps(out, scene) == said


def test_statics_raise_their_margin_by_themselves():
    """One hex drawn to twice its length, which bursts with the margin that small strains need."""
    one = box((0.01, 0.01, 0.01), (1, 1, 1))
    ends = np.arange(8)
    top = one.points[:, 2] > 0.005
    pattern = np.zeros((8, 3))
    pattern[top, 2] = 1.0
    held = np.zeros((8, 3))
    held[:, 2] = 1.0
    held[np.linalg.norm(one.points[:, :2] + 0.005, axis=1) < 1e-9, :2] = 1.0
    held[np.linalg.norm(one.points[:, :2] + [-0.005, 0.005], axis=1) < 1e-9, 1] = 1.0
    scene = tissue(
        ReducedPolynomial(order=1), cases.NEO, 1e6, Geometry(one.points, one.cells, one.cell_type, ends), held=held
    ).put(
        {
            "support.time": jnp.arange(2.0), "support.pattern": jnp.asarray(pattern),
            "support.displacement": jnp.asarray([[0.0, 0.0, 0.01]] * 2),
        }
    )  # fmt: skip
    found = statics.checked(statics.compiled(scene))
    stretched = one.points + np.asarray(found.displacement)
    assert np.ptp(stretched[:, 0]) == pytest.approx(0.01 / np.sqrt(2), rel=2e-3)  # K/mu 833: all but incompressible


@pytest.mark.slow
def test_statics_that_have_no_answer_say_how_far_they_came():
    g = box((0.02, 0.02, 0.02), (2, 2, 2))
    soft = tissue(ReducedPolynomial(order=1), dict(C10=50.0), 1e3, g, gravity=(0, 0, -981.0))
    with pytest.raises(NotConverged, match=r"no static equilibrium beyond \d+% of gravity: .* nodes are held"):
        statics.gradual(soft, most=300)
    found = gravity.compiled(soft, rounds=2)
    with pytest.raises(NotConverged, match="no stress-free shape"):
        gravity.checked(found, soft)
