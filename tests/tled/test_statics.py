"""Static equilibrium and the stress-free shape: found, agreed with the dynamics, and differentiated."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import test_indentation as indentation
from tests.tled import cases
from tissuejax.errors import InputError, NotConverged
from tissuejax.mesh.columns import box
from tissuejax.tled import gravity, statics
from tissuejax.tled.simulate import COMPILER_OPTIONS, run

BLOCK = box((0.03, 0.03, 0.012), (3, 3, 2))
DOWN = (0.0, 0.0, -9.81)


def test_relaxation_finds_where_the_damped_motion_comes_to_rest():
    times = np.arange(1, 41) * 0.01
    scene = cases.plain(BLOCK, times, order=2, gravity=DOWN, mass_damping=80.0)
    found = statics.checked(statics.compiled(scene))
    assert float(found.residual) < 1e-9
    settled = run(scene).state.u.T
    assert np.allclose(found.displacement, settled, atol=1e-5 * float(jnp.abs(settled).max()))


def test_the_implicit_derivative_equals_difference_quotients_and_its_reverse():
    scene = cases.pressed(BLOCK)

    def outcome(x):
        changed = scene.put({"tissue.energy_values.C10": 600 * x[0], "tissue.volumetric_values.K": 15e3 * x[1]})
        found = statics.equilibrium(changed, 0.2, tolerance=1e-11)
        return jnp.concatenate([found.force, 100 * found.displacement.ravel()])

    @jax.jit
    def forward(x, d):
        return jax.jvp(outcome, (x,), (d,))

    x, h = jnp.ones(2), 1e-5
    w = jnp.cos(jnp.arange(3.0 + BLOCK.points.size))
    tangents = []
    for d in jnp.eye(2):
        exact = forward(x, d)[1]
        quotient = (forward(x + h * d, d)[0] - forward(x - h * d, d)[0]) / (2 * h)
        assert float(jnp.linalg.norm(exact - quotient) / jnp.linalg.norm(quotient)) < 1e-6
        tangents.append(exact @ w)
    gradient = jax.jit(jax.grad(lambda x: outcome(x) @ w))(x)
    assert np.allclose(gradient, tangents, rtol=1e-6)


def test_gravity_brings_the_measured_shape_back():
    scene = cases.plain(BLOCK, np.arange(2.0), order=2, gravity=DOWN)
    found = gravity.compiled(scene)
    assert float(found.sag) > 1e-4
    assert float(found.miss) < 1e-6 * float(found.sag) + 1e-9
    down = statics.checked(statics.compiled(found.scene.put({"body.settled": None})))
    back = found.scene.body.points + down.displacement
    assert np.allclose(back, BLOCK.points, atol=1e-8)


@pytest.mark.parametrize("rounds", [1, 3, 40])
def test_each_round_brings_the_shape_nearer_by_the_sag_of_its_own(monkeypatch, rounds):
    """An organ that gravity shrinks by s of itself: X = x / (1 - s), reached as a geometric series. After so many
    rounds the miss is that power of s, and a search that has come to 1e-7 of the height goes on no longer."""
    s = 0.2

    def shrunk(scene, **options):
        zero = jnp.zeros(())
        return statics.Equilibrium(-s * scene.body.points, zero, jnp.asarray(0), jnp.zeros(3), zero > 0)

    monkeypatch.setattr(statics, "equilibrium", shrunk)
    scene = cases.plain(BLOCK, np.arange(2.0), order=2, gravity=DOWN)
    found = gravity.stress_free(scene, rounds=rounds)
    taken = min(rounds, 11)  # the largest coordinate is 15 mm, the height 12 mm: s^10 > 0.8e-7 > s^11
    assert float(found.miss) == pytest.approx(0.015 * s**taken, rel=1e-3)
    exact = BLOCK.points / (1 - s)
    np.testing.assert_allclose(found.scene.body.points, exact - s ** (taken + 1) * exact, atol=1e-15)
    np.testing.assert_allclose(found.scene.body.settled, BLOCK.points - found.scene.body.points, atol=1e-15)


def test_gravity_is_balanced_as_exactly_as_the_shape_is_sought(monkeypatch):
    """Equilibria that are off by all they may be, a share of their sag, leave the shape where rounds end: within 1e-7
    of the height."""
    s = 0.2

    def nearly(scene, tolerance, **options):
        zero = jnp.zeros(())
        u = -s * (1 + tolerance) * scene.body.points
        return statics.Equilibrium(u, zero, jnp.asarray(0), jnp.zeros(3), zero > 0)

    monkeypatch.setattr(statics, "equilibrium", nearly)
    found = gravity.stress_free(cases.plain(BLOCK, np.arange(2.0), order=2, gravity=DOWN), rounds=40)
    np.testing.assert_allclose(found.scene.body.points, BLOCK.points / (1 - s), atol=1e-7 * 0.012)


@pytest.mark.slow
def test_the_unloaded_shape_follows_the_material():
    scene = cases.plain(BLOCK, np.arange(2.0), order=2, gravity=DOWN)

    def shape(c):
        softer = scene.put({"tissue.energy_values.C10": 600 * c})
        return 1e3 * gravity.stress_free(softer, rounds=20, tolerance=1e-11).scene.body.points.ravel()

    both = jax.jit(lambda c: jax.jvp(shape, (c,), (1.0,)), compiler_options=COMPILER_OPTIONS)
    quotient = (both(1.001)[0] - both(0.999)[0]) / 2e-3
    assert float(jnp.linalg.norm(both(1.0)[1] - quotient) / jnp.linalg.norm(quotient)) < 1e-5


def test_what_has_no_answer_says_so():
    with pytest.raises(InputError, match="needs gravity"):
        gravity.stress_free(cases.plain(BLOCK, np.arange(2.0)))
    with pytest.raises(NotConverged, match="no static equilibrium after 25 iterations"):
        statics.checked(statics.compiled(cases.plain(BLOCK, np.arange(2.0), gravity=DOWN), most=25))


@pytest.mark.parametrize(("precision", "said"), [(jnp.float32, True), (jnp.float64, False)])
def test_a_search_that_stalls_in_single_precision_says_what_to_switch_on(precision, said):
    lost = jnp.full((4, 3), jnp.nan, precision)
    stalled = statics.Equilibrium(lost, jnp.asarray(2e-3), jnp.asarray(25), jnp.zeros(3), jnp.asarray(False))
    with pytest.raises(NotConverged, match="unbalanced force 2.0e-03") as refusal:
        statics.checked(stalled)
    assert ("jax_enable_x64" in str(refusal.value)) == said


@pytest.mark.parametrize(("longest", "last"), [(0.3, 1.0), (1 / 64, 1.0), (0.99 / 64, 0.0)])
def test_a_load_is_led_in_steps_that_find_their_equilibrium(monkeypatch, longest, last):
    """Of a search that finds equilibrium only so near to the last one: halved down to a 64th of the way it arrives,
    and each search begins where the one before ended. Where a 64th is too far it says so."""
    tried = []

    def near(scene, when, **options):
        begun = float(scene.body.settled.max())
        tried.append((begun, when))
        u = jnp.full_like(scene.body.points, when if when <= begun + longest else jnp.nan)
        return statics.Equilibrium(u, jnp.asarray(1e-3), jnp.asarray(25), jnp.zeros(3), jnp.asarray(False))

    monkeypatch.setattr(statics, "compiled", near)
    scene = cases.plain(BLOCK, 0.5 + np.arange(2.0))
    assert float(scene.clock.start) == 0.0
    if last < 1:
        with pytest.raises(NotConverged, match=r"beyond 0% of the way \(t = 0 of 1 s\): unbalanced force 1.0e-03"):
            statics.gradual(scene, 1.0)
        assert [when for _, when in tried] == [0.5**k for k in range(7)]
        return
    assert float(statics.gradual(scene, 1.0).displacement.max()) == last
    reached = [0.0]
    for (begun, when), (_, then) in zip(tried, tried[1:] + [(1.0, 1.0)], strict=True):
        assert begun == reached[-1]
        step = when - begun
        if step > longest:
            assert then == begun + step / 2
        else:
            assert then == min(1.0, when + 2 * step)
            reached.append(when)
    assert reached[-1] == 1.0
    assert np.diff(reached[:-1]).min() > longest / 2  # longer steps are tried again


def test_gravity_is_led_before_the_way(monkeypatch):
    """Where the probe and the support are at the start; a body that has settled already skips it."""
    tried = []

    def found(scene, when, **options):
        tried.append((float(scene.gravity[2]), when, float(scene.body.settled.max())))
        u = jnp.full_like(scene.body.points, len(tried) if tried[-1][0] < -1 else jnp.nan)
        return statics.Equilibrium(u, jnp.asarray(1e-3), jnp.asarray(25), jnp.zeros(3), jnp.asarray(False))

    monkeypatch.setattr(statics, "compiled", found)
    scene = cases.plain(BLOCK, 0.5 + np.arange(2.0), gravity=DOWN)
    statics.gradual(scene, 0.8)
    assert tried == [(-9.81, 0.0, 0.0), (-9.81, 0.8, 1.0)]
    tried.clear()
    statics.gradual(scene.put({"body.settled": jnp.full_like(scene.body.points, 7.0)}), 0.8)
    assert tried == [(-9.81, 0.8, 7.0)]
    weak = scene.put({"gravity": jnp.array([0.0, 0.0, -0.5])})
    with pytest.raises(NotConverged, match=r"beyond 0% of gravity: .* is 0.005 times its shear modulus"):
        statics.gradual(weak, 0.8)


def test_an_answer_with_inverted_elements_is_none():
    """A ball that jumps two elements deep turns them inside out, and the search comes to rest there."""
    deep = indentation.scene((12, 9), 0.02)
    found = statics.compiled(deep, 2e-3 / 0.02, tolerance=2e-6, margin=4.0)
    with pytest.raises(NotConverged, match="inverted|burst"):
        statics.checked(found)
