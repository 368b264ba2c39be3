"""From statics to a file: held-out errors, resuming, the file's guards, and what is refused."""

import h5py
import jax.numpy as jnp
import numpy as np
import pytest

from tests.surrogate import made
from tissuejax.errors import InputError
from tissuejax.surrogate import ramp as ramps
from tissuejax.surrogate import store
from tissuejax.surrogate.live.ask import Asker
from tissuejax.surrogate.memory import narrow
from tissuejax.surrogate.places import Box, checked, first_contact, whole_top
from tissuejax.surrogate.precompute import precompute
from tissuejax.surrogate.ramp import scene_at, slip
from tissuejax.surrogate.site_mesh import Grid, lines
from tissuejax.surrogate.tabulate import slip_fitted


def test_first_contact_of_a_sphere_on_a_sphere():
    """Over a dome of radius S the ball's centre lies on a sphere of radius S + R."""
    from tissuejax.mesh.columns import Lobe

    s = np.linspace(0, 1, 41)
    x, y = np.meshgrid(0.08 * s - 0.04, 0.08 * s - 0.04, indexing="ij")
    top = np.sqrt(0.06**2 - x**2 - y**2) - 0.02
    lobe = Lobe.of_grid(s, s, x, y, 0 * x - 0.03, top)
    box = Box(np.array([-0.01, -0.012]), np.array([0.012, 0.01]), 5e-3, (3, 3))
    places = box.held_out(8)
    wanted = np.sqrt((0.06 + 5e-3) ** 2 - (places**2).sum(1)) - 0.02
    assert first_contact(lobe, box, 5e-3).sample(places)[:, 0] == pytest.approx(wanted, abs=3e-6)


def test_the_fine_part_is_the_same_on_both_sides_and_moves_with_the_site():
    grid = Grid((16, 16, 4), 4.75e-3)
    for place in ([0.0, 0.0], [0.004, -0.003]):
        s, t = (0.04 * v - 0.02 for v in lines(made.SLAB, np.array(place), grid))
        for line, at in ((s, place[0]), (t, place[1])):
            middle = len(line) // 2
            assert line[middle] == pytest.approx(at, abs=1e-9)
            assert line[middle + 1 : middle + 6] - at == pytest.approx(at - line[middle - 5 : middle][::-1], abs=1e-12)
            assert (np.diff(line) > 0).all()


def test_near_the_rim_the_core_is_narrower_on_that_side_alone():
    """7 mm from the left rim: elements on the right are as large as anywhere."""
    grid = Grid((16, 16, 4), 4.75e-3)
    s, _ = lines(made.SLAB, np.array([-0.013, 0.0]), grid)
    middle, _ = lines(made.SLAB, np.array([0.0, 0.0]), grid)
    sizes, usual = 0.04 * np.diff(s), 0.04 * np.diff(middle)
    assert sizes[8:13] == pytest.approx(usual[8:13], abs=1e-12)
    assert sizes[3:8] == pytest.approx(0.75 * 7e-3 / 5, abs=1e-9)
    assert sizes[:3].sum() + sizes[3:8].sum() == pytest.approx(7e-3, abs=1e-9)


@pytest.mark.slow
def test_error_at_held_out_places_is_measured_and_small():
    found = made.small()
    error = found.record["error"]
    assert error["states"] == 24
    assert error["surface_worst_m"] < 2e-4
    assert error["lateral_worst_N"] < 2e-3
    # a state of the table itself comes back
    place = made.SMALL_BOX.sites()[0, 1]
    contact = 0.014 + 4e-3
    state = ramps.ramp(made.matter(), made.SMALL, place, contact, made.SMALL_BOX.levels)
    s = found.surrogate
    got = [s.elastic(np.array([*place, contact - d]))[2] for d in made.SMALL_BOX.levels]
    assert np.asarray(got) == pytest.approx(state.force[:, 2], rel=1e-3)
    assert state.force[-1, 2] > 0.02


def test_the_vertical_error_and_the_place_of_the_worst_are_told_apart():
    """A formula's force, and states that differ from it: 2 % upright at one place, 5 % sideways at another."""
    from tissuejax.surrogate.error import held_out

    s, states = made.formula(), []
    for place, wrong in (([2e-3, 1e-3], [0, 0, 0.02]), ([-4e-3, 2e-3], [0.05, 0, 0])):
        depth = np.array([4e-3, 6e-3])
        force = np.array([np.asarray(s.elastic(made.at(*place, d))) for d in depth])
        force = force + np.array(wrong) * force[:, 2:]
        moved = np.zeros((2, s.surface.modes.shape[1], 3))
        states.append(ramps.Ramp(np.array(place), depth, force, moved, moved[0], *(np.ones(2),) * 3))
    found = held_out(s, states)
    assert found["vertical_worst"] == pytest.approx(0.02 / 1.02, rel=1e-2)
    assert found["force_worst"] == pytest.approx(0.05, rel=1e-2)
    assert found["worst_at_m"][:2] == [-4e-3, 2e-3]
    assert found["lateral_worst_N"] == pytest.approx(0.05 * max(states[1].force[:, 2]), rel=1e-3)


def test_a_held_press_relaxes_to_the_long_term_share():
    """Pressed at once and held long, the isochoric part of the work falls by g1 + g2 and no more; the bulk part and the
    hourglass control of so coarse a mesh do not."""
    s = made.small().surrogate
    p = np.array([0.0, 0.0, 0.018 - 1.9e-3])
    time = np.concatenate([[0, 1e-4], np.linspace(0.1, 60, 50)])
    path = np.concatenate([[p + [0, 0, 3e-3]], np.tile(p, (51, 1))])
    asker = Asker(s)
    force = np.array([asker.tick(p, dt)[2] for p, dt in zip(path, np.diff(time, prepend=0))])
    share = 1 - force[-1] / force[1]
    assert 0.1 < share <= 0.35 + 1e-3
    assert (np.diff(force[1:]) <= 1e-9).all()


def test_sites_are_kept_and_a_second_run_takes_them(tmp_path, monkeypatch):
    first = precompute(made.matter(), made.SMALL_BOX, made.SMALL, keep=tmp_path, processes=1, numerical=False)
    assert len(list(tmp_path.glob("site-*.npz"))) == 10
    monkeypatch.setattr("tissuejax.surrogate.precompute.ramp", None)  # nothing is computed again
    again = precompute(made.matter(), made.SMALL_BOX, made.SMALL, keep=tmp_path, processes=1, numerical=False)
    assert np.array_equal(first.surrogate.law.coefficients, again.surrogate.law.coefficients)


def test_sites_are_added_until_the_error_is_reached_or_they_no_longer_help(monkeypatch):
    """Errors by the number of sites, as the full model would give them; the sites themselves are not computed."""
    from tissuejax.surrogate import error
    from tissuejax.surrogate import precompute as at_work

    def run(wanted, errors):
        counted = []

        def none(self, places, depths, what, fields=None):
            one = ramps.Ramp(*(np.zeros(1),) * 8)._replace(force=np.array([[0, 0, 0.1]]))
            counted.append(len(places))
            return [one] * len(places)

        told = iter(errors)
        monkeypatch.setattr(at_work._Sites, "all", none)
        monkeypatch.setattr(at_work, "surrogate", lambda *given: None)
        monkeypatch.setattr(at_work, "summary", lambda surrogate: {})
        monkeypatch.setattr(error, "held_out", lambda made, tests: {"force_worst": next(told)})
        found = precompute(made.matter(), box, made.SMALL, wanted, processes=1, numerical=False)
        return found.record, counted

    box = made.SMALL_BOX._replace(counts=(2, 2))
    record, counted = run(0.01, [0.05, 0.02, 0.009])
    assert counted == [6, 4, 9, 25]
    assert record["box"]["sites"] == [5, 5]
    assert [r["force_worst"] for r in record["rounds"]] == [0.05, 0.02, 0.009]
    with pytest.raises(InputError, match=r"4.8 % with 3 x 3 sites, wanted is 1 %, and was 5 % .* more --depths"):
        run(0.01, [0.05, 0.048])
    with pytest.raises(InputError, match=r"0.13 % with 33 x 33 sites, .* smaller --reach or allow more --error"):
        run(0.001, [0.04, 0.02, 0.01, 0.005, 0.0025, 0.0013])


def test_modes_are_those_of_a_singular_value_decomposition_also_in_blocks(monkeypatch):
    from tissuejax.surrogate import modes as at_work

    rng = np.random.default_rng(2)
    states = (rng.normal(size=(9, 3)) @ rng.normal(size=(3, 50)) + 1e-5 * rng.normal(size=(9, 50))).astype(np.float32)
    weight = rng.uniform(0.5, 2, 50)
    monkeypatch.setattr(at_work, "BLOCK", 7)
    found = at_work.modes(states, 1e-3, 8, weight)
    _, _, wanted = np.linalg.svd(states * np.sqrt(weight), full_matrices=False)
    assert found.shapes.shape == (3, 50)
    assert np.abs(found.shapes * np.sqrt(weight) @ wanted[:3].T) == pytest.approx(np.eye(3), abs=1e-4)
    rest = states - (states * weight) @ found.shapes.T @ found.shapes
    assert np.linalg.norm(rest * np.sqrt(weight)) / np.linalg.norm(states * np.sqrt(weight)) == pytest.approx(
        found.lost, rel=1e-3
    )


def test_the_file_comes_back_and_damage_is_seen(tmp_path):
    found = made.small()
    path = store.write(found, tmp_path / "a.play.h5")
    back = store.read(path)
    p = np.array([0.001, -0.002, 0.018 - 1.5e-3])
    assert np.asarray(back.surrogate.elastic(p)) == pytest.approx(np.asarray(found.surrogate.elastic(p)), rel=1e-12)
    assert back.record["error"]["force_worst"] == pytest.approx(found.record["error"]["force_worst"], nan_ok=True)

    def spoilt(name, change):
        copy = tmp_path / name
        copy.write_bytes(path.read_bytes())
        with h5py.File(copy, "a") as file:
            change(file)
        return copy

    with pytest.raises(InputError, match="hash"):
        store.read(spoilt("b.h5", lambda f: f["law/coefficients"].__setitem__((0, 0, 0, 0), 7.0)))
    with pytest.raises(InputError, match="not a number"):
        store.read(spoilt("c.h5", lambda f: f["law/coefficients"].__setitem__((0, 0, 0, 0), np.nan)))
    with pytest.raises(InputError, match="version 9"):
        store.read(spoilt("d.h5", lambda f: f.attrs.__setitem__("version", 9)))
    with pytest.raises(InputError, match="not a surrogate"):
        store.read(spoilt("e.h5", lambda f: f.attrs.__setitem__("format", "x")))
    cut = tmp_path / "f.h5"
    cut.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match="cut off"):
        store.read(cut)
    with pytest.raises(InputError, match="no such file"):
        store.read(tmp_path / "none.h5")


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"depth": 0.0095}, "60 %"),
        ({"high": np.array([0.019, 0.003])}, "from its rim"),
        ({"high": np.array([0.025, 0.003])}, "outside the organ"),
        ({"depth": -1.0}, "positive"),
    ],
)
def test_a_box_that_the_organ_does_not_hold_is_refused(change, word):
    with pytest.raises(InputError, match=word):
        checked(made.SMALL_BOX._replace(**change), made.SLAB, 4e-3)


def test_the_whole_top_keeps_its_distance_from_the_rim():
    low, high = whole_top(made.SLAB, 4e-3)
    assert np.allclose(high, 0.014, atol=1e-3)
    assert np.allclose(low, -0.014, atol=1e-3)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("softening", {"m": 50.0, "r": 0.3}),
        ("base-slip", {"compliance": 1e-6}),
        ("support-motion", {"sin": 1e-3}),
        ("compressibility", {"drained": 1e-4}),
    ],
)
def test_what_cannot_be_tabulated_is_refused_by_its_name(name, values):
    from tissuejax import effects
    from tissuejax.effects.effect import Effect
    from tissuejax.families import members
    from tissuejax.surrogate.refusals import refuse

    kind = members(effects, Effect)[name]
    effect = kind()
    amounts = {f"effects.{name}.{k}": v for k, v in values.items()}
    with pytest.raises(InputError, match=f"effect {name} can't be tabulated.*--direct"):
        refuse(made.matter(effect, **amounts), made.SMALL, [0.0, 0.0])
    refuse(made.matter(effect), made.SMALL, [0.0, 0.0])  # at its neutral value it is no matter


def test_a_box_too_wide_for_the_memory_of_stress_is_refused():
    wide = Box(np.array([-0.02, -0.01]), np.array([0.02, 0.01]), 5e-3, (3, 3))
    with pytest.raises(InputError, match=r"40 x 20 mm with relaxation.* 36 mm at most.*--reach 18"):
        narrow(wide)
    narrow(wide._replace(low=np.array([-0.016, -0.01])))


def test_a_failed_site_says_place_and_depth(monkeypatch):
    from tissuejax.errors import NotConverged

    monkeypatch.setattr(ramps, "MOST_STEPS", 25)
    with pytest.raises(NotConverged, match=r"place \(1.0, 2.0\) mm, depth"):
        ramps.ramp(made.matter(), made.SMALL, [1e-3, 2e-3], 0.018, [1e-3])


def test_friction_takes_the_stretch_of_the_surface_along_the_way():
    """Surface stretched by 1.3 along x and 1.1 along y under a ball of 1 m: the mean of both. Unstretched, a small
    ball deep in it: forces over their vertical sum, from points of a sphere."""
    place, radius = np.zeros(2), made.matter().radius
    top = float(made.SLAB.top(0.5, 0.5)[0, 0])
    scene = scene_at(made.matter(), made.SMALL, place, top + radius)
    points = np.asarray(scene.body.points)
    stretched = points * np.array([0.3, 0.1, 0.0])
    flat = scene.put({"probe.shape.radius": jnp.asarray(1.0)})
    shallow = float(slip(flat, jnp.asarray(stretched), jnp.array([0.0, 0.0, top + 1.0 - 1e-4])))
    assert shallow == pytest.approx(1.2, abs=1e-3)
    cap = np.array([[0.0, 0.0, top + radius - 1e-3]])
    deep = float(slip(scene, jnp.asarray(0 * points), jnp.asarray(cap[0])))
    rho = np.linspace(0, np.sqrt(radius**2 - (radius - 1e-3) ** 2), 4001)
    gap = radius - np.hypot(rho, radius - 1e-3)
    up = (radius - 1e-3) / np.hypot(rho, radius - 1e-3)
    assert deep == pytest.approx(np.trapezoid(gap * rho, rho) / np.trapezoid(gap * up * rho, rho), rel=0.02)


def test_slip_is_fitted_over_the_depth():
    q = np.linspace(0.1, 1, 8)
    wanted = np.array([0.3, -0.1, 0.25])
    slips = np.tile(1 + q * (wanted[0] + q * (wanted[1] + q * wanted[2])), (5, 1))
    slips[2, 0] = np.inf  # a site that was not touched
    np.testing.assert_allclose(slip_fitted(q, slips), wanted, atol=1e-10)
