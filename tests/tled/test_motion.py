"""The explicit step: momentum, energy, order of convergence, refusals, and long runs that stop and go on."""

from xml.etree import ElementTree

import h5py
import jax
import jax.numpy as jnp
import meshio
import numpy as np
import pytest

from tests.tled import cases
from tissuejax.errors import InputError, UnstableSimulation
from tissuejax.mesh.columns import box
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import build, contact, internal, ledger, stable, stream
from tissuejax.tled.build import ProbePath
from tissuejax.tled.shapes import Platen
from tissuejax.tled.simulate import compiled, run, simulate
from tissuejax.tled.step import machine

FRAMES = 36  # a square: no frames beyond the last are run


@pytest.fixture(scope="module")
def pressed():
    """A frictionless press without damping, and what came out."""
    scene = cases.pressed(frames=FRAMES, mass_damping=0.0, compression=10.0).put({"clock.steps": 24})
    return scene, run(scene)


def test_force_on_probe_and_support_agree_to_the_change_of_momentum(pressed):
    """force + reaction = - d(momentum)/dt, exactly so in central differences: the impulse of the whole run is the
    momentum of the free nodes at its end (of the contact's static mass too)."""
    scene, out = pressed
    free = np.ones(len(scene.body.points))
    free[np.asarray(scene.body.fixed)] = 0.0
    mass = np.asarray(machine(scene).mass) * free
    impulse = np.asarray(out.force + out.reaction).sum(0) * float(scene.clock.interval / scene.clock.compression)
    momentum = np.asarray(out.state.v) @ mass
    assert np.allclose(impulse, -momentum, atol=1e-9 * np.abs(np.asarray(out.force)).sum())


def test_the_work_of_the_probe_is_found_again_as_energy(pressed):
    """Kinetic, strain, hourglass and penalty energy = work of the probe, all at the time of the last speeds, half a
    step before the end: what is missing is of the second order in the step (the static mass of contact, which belongs
    to the body whose motion is followed, stays as it is), and a thousandth at 24 steps a frame."""
    scene, out = pressed
    coarse = scene.put({"clock.steps": scene.clock.steps // 2})
    missing = _missing(scene, out)
    assert abs(missing) < 1e-3
    assert 3 < _missing(coarse, run(coarse)) / missing < 5


def _missing(scene, out):
    """Share of the probe's work that is not found again."""
    m = machine(scene)
    u = ledger.midway(m, out.state)
    when = out.end_time[-1] - 0.5 * scene.clock.step * scene.clock.compression
    centre = jnp.stack([jnp.interp(when, scene.probe.time, scene.probe.position[:, i]) for i in range(3)])
    elastic, _, hourglass = internal.internal_energy(scene, m.mesh, u)
    kinetic = 0.5 * jnp.sum(m.mass * out.state.v**2)
    stored = elastic + hourglass + kinetic + contact.energy(scene.probe, m.patch, u, centre)
    return float(1 - stored / out.work[-1])


def test_a_free_fall_of_the_whole_body_is_exact():
    """No node is held: u = g t^2 / 2 in central differences, and the momentum is m g t; half a step before, where the
    speed is known, the kinetic energy is m v^2 / 2 with v = g t, and nothing is strained."""
    g = box((0.02, 0.02, 0.02), (2, 2, 2))
    times = np.arange(1, 21) * 1e-3
    held = np.zeros((len(g.fixed), 3))
    scene = cases.plain(g, times, gravity=(0, 0, -9.81), held=held, mass_damping=0.0)
    out = run(scene)
    t = float(out.end_time[-1]) - float(out.end_time[0]) + 1e-3
    assert np.allclose(out.state.u[2], -9.81 * t**2 / 2, rtol=1e-9)
    assert np.allclose(out.state.u[:2], 0, atol=1e-15)
    speed = 9.81 * (np.asarray(out.check_time - out.check_time[-1]) + t - 0.5 * float(scene.clock.step))
    np.testing.assert_allclose(out.checks.kinetic, 0.5 * 1000 * 0.02**3 * speed**2, rtol=1e-9)
    assert np.abs(out.checks.internal).max() < 1e-12 * float(out.checks.kinetic[0])


def test_second_order_in_the_step():
    """Gravity switched on: the top's displacement after a while, steps h, h/2, h/4 (source 4.3.3 at small size)."""
    g = box((0.05, 0.05, 0.05), (2, 2, 2))
    times = np.arange(1, 11) * 2e-3

    def top(steps):
        scene = cases.plain(g, times, gravity=(0, 0, -9.81)).put({"clock.steps": steps})
        return float(run(scene).state.u[2].min())

    a, b, c = (top(n) for n in (4, 8, 16))
    assert 3.3 < (a - b) / (b - c) < 4.7


def test_what_is_not_given_is_chosen():
    """Damping: half the lowest shear frequency, that of a quarter wave over the height. The clock begins half a frame
    before the first middle, in steps of at most 0.7 of the critical one."""
    g = box((0.03, 0.02, 0.012), (3, 2, 2))
    times = 0.1 + np.arange(5) * 0.04
    scene = cases.plain(g, times, compression=4.0)
    c = np.sqrt(2 * cases.NEO["C10"] / 1000.0)
    assert float(scene.settings.mass_damping) == pytest.approx(0.5 * 2 * np.pi * c / (4 * 0.012), rel=1e-12)
    assert float(scene.clock.start) == pytest.approx(0.08)
    most = 0.7 * float(stable.critical_steps(scene).min())
    assert 0.01 / scene.clock.steps <= most < 0.01 / (scene.clock.steps - 1)
    given = cases.plain(g, times, mass_damping=3.0, hourglass=0.2, stiffness_damping=1e-5, compression=4.0).settings
    assert [float(x) for x in (given.mass_damping, given.hourglass, given.stiffness_damping)] == [3.0, 0.2, 1e-5]


def test_a_step_above_the_critical_one_is_refused_and_one_forced_in_is_caught():
    g = box((0.02, 0.02, 0.02), (3, 3, 3))
    times = np.arange(1, 9) * 0.02
    with pytest.raises(InputError, match="critical step"):
        cases.plain(g, times, step=0.01)
    wild = cases.plain(g, times, gravity=(0, 0, -9.81)).put({"clock.steps": 5})
    with pytest.raises(UnstableSimulation, match=r"broke down by t = .* element \d+"):
        run(wild, halvings=0)


def test_a_burst_names_the_element_in_which_it_began():
    """One element is made so stiff that the step is too long for it; by the next look all nodes are NaN."""
    g = box((0.05, 0.05, 0.05), (5, 5, 5))
    times = np.arange(1, 26) * 0.01
    scene = cases.plain(g, times, gravity=(0, 0, -9.81))
    middle = 62
    field = jnp.ones(len(g.cells)).at[middle].set(12.0)
    with pytest.raises(UnstableSimulation, match=r"broke down by t = .* element \d+ near .* smaller step") as caught:
        run(scene.put({"tissue.stiffness": field}), halvings=0)
    named = int(str(caught.value).split("element ")[1].split()[0])
    assert np.isin(g.cells[named], g.cells[middle]).any()  # the element itself or one that touches it


def test_a_probe_that_starts_inside_or_stays_away_is_refused():
    g = box((0.03, 0.03, 0.012), (5, 5, 3))
    t = np.arange(3.0)
    for height, radius, words in (
        (0.015, 0.006, "inside the tissue"),
        (0.2, 0.006, "off the tissue"),
        (0.2, 0.0, "radius"),
    ):
        with pytest.raises(InputError, match=words):
            cases.plain(g, t, probe_path=ProbePath(t, np.tile([0, 0, height], (3, 1)), radius))


def test_a_run_that_is_stopped_goes_on_bit_for_bit(tmp_path):
    scene = cases.pressed(frames=3 * stream.CHUNK).put({"probe.friction": jnp.asarray(0.2)})
    stream.run_to_file(scene, tmp_path / "whole.h5")
    stream.run_to_file(scene, tmp_path / "parts.h5", chunks=1)
    stream.run_to_file(scene, tmp_path / "parts.h5")
    with h5py.File(tmp_path / "whole.h5") as a, h5py.File(tmp_path / "parts.h5") as b:
        for name in ("channels/force", "channels/reaction", "states/displacement/2"):
            assert np.array_equal(a[name], b[name])
        assert len(a["channels/force"]) == scene.clock.frames
        assert np.abs(a["channels/force"][...] - np.asarray(compiled(scene).force)).max() < 1e-9
        last = a["states/displacement/2"][...]
    mesh = meshio.read(stream.to_vtu(tmp_path / "whole.h5", tmp_path / "last.vtu"))
    assert np.allclose(mesh.points, scene.body.points)
    assert np.allclose(mesh.point_data["displacement"], last)
    tree = ElementTree.parse(stream.to_xdmf(tmp_path / "whole.h5", tmp_path / "whole.xdmf"))
    with h5py.File(tmp_path / "whole.h5") as file:
        for item in tree.iter("DataItem"):
            assert file[item.text.split(":")[1]].shape == tuple(map(int, item.get("Dimensions").split()))
    assert [float(t.get("Value")) for t in tree.iter("Time")] == pytest.approx([0.5 / 3, 1.0 / 3, 0.5])


STIFF, SINKS, START = 1e8, 0.05, 1e-5  # Pa/m, m/s, m above the face
BLOCK = (0.02, 0.016, 0.012)
quick = jax.jit(simulate, compiler_options={"xla_backend_optimization_level": "0"})  # compiled for one use


@pytest.fixture(scope="module")
def rigid():
    """A platen that goes down evenly into a block all of whose nodes are held; four frames, two to a block."""
    g = box(BLOCK, (3, 2, 2))
    g = Geometry(g.points, g.cells, g.cell_type, np.arange(len(g.points)))
    bare = cases.plain(g, (np.arange(4) + 0.5) * 0.01, compression=4.0).put({"clock.steps": 6})
    time = np.array([-1.0, 1.0])
    path = np.array([[0.0, 0.0, BLOCK[2] + START - SINKS * t] for t in time])
    top = np.asarray(bare.body.facets)
    top = top[np.isclose(g.points[top][:, :, 2], BLOCK[2]).all(1)]
    probe = build.probe(bare, Platen(), time, path, top, STIFF, 1e-8)
    corner = int(np.argmax(g.points @ [1.0, 1.0, -1.0]))  # away from the platen, of one element alone
    return corner, bare.put(
        {
            "probe": probe, "probe.compliance": jnp.asarray(0.0),
            "support.time": jnp.array([0.0, 0.0105, 0.02]), "support.displacement": jnp.zeros((3, 3)),
            "support.pattern": jnp.zeros((len(g.points), 3)).at[corner, 2].set(1.0),
        }
    )  # fmt: skip


@pytest.mark.parametrize("give", [0.0, 0.64, 3.0])
def test_a_rigid_block_is_penetrated_as_far_as_the_machine_does_not_give_way(rigid, give):
    """Depth d of the path, contact stiffness k = penalty x area, machine C: k (d - C F) = F, so it goes in by
    d / (1 + C k) at the end of a frame; a machine that gives way does so to the force of the last step's start. A stiff
    one's force is k d at the force's own time: the mean over the starts of its steps; its work k d^2 / 2, half a step
    before the end."""
    _, scene = rigid
    k = STIFF * BLOCK[0] * BLOCK[1]
    out = quick(scene.put({"probe.compliance": jnp.asarray(give / k)}))
    deep = lambda t: (SINKS * np.asarray(t) - START)[1:]  # noqa: E731  it touches in the first frame
    last = float(scene.clock.interval) / scene.clock.steps
    given = give / (1 + give) * deep(out.end_time - last)
    np.testing.assert_allclose(out.penetration[1:], deep(out.end_time) - given, rtol=1e-9)
    if not give:
        np.testing.assert_allclose(out.force[1:, 2], k * deep(out.time), rtol=1e-9)
        stored = 0.5 * k * deep(out.end_time - 0.5 * last) ** 2
        np.testing.assert_allclose(np.diff(out.work[1:]), np.diff(stored), rtol=1e-9)


def test_a_burst_in_the_last_frame_before_a_look_is_put_where_it_began(rigid):
    """One corner of a rigid block is moved, and torn off in the second of two frames between looks: the element named
    has that corner, none of the others is wrong."""
    corner, scene = rigid
    torn = jnp.array([[0.0] * 3, [0.0, 0.0, -1e-5], [0.0, 0.0, -1e307]])  # its speed overflows
    out = quick(scene.put({"support.displacement": torn}))
    assert int(out.failed) == 1
    assert corner in scene.body.cells[int(out.element)]
