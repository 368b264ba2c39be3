"""A probing sample from a lab's files: body, registration, lift, series of every kind, and each refusal."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from tissuejax.cli import main
from tissuejax.errors import InputError
from tissuejax.mesh.probing_files import probing_sample
from tissuejax.recordings.files import read

T = np.linspace(0, 4, 41)
# Straight down and up over a slab of 20 mm, a ball of 5 mm, 3 mm deep.
CENTRE = np.stack([0 * T, 0 * T, 20 + 5 + 1 - 4 * np.minimum(T, 4 - T) / 2], axis=1)
FORCE = np.stack([0 * T, 0 * T, np.clip(np.minimum(T, 4 - T) - 0.5, 0, None)], axis=1)
MARKS = np.array([[10.0, 0, 20], [-10, 0, 20], [0, 10, 20], [0, -10, 20]])
TURN = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # a frame turned by 90 degrees
SHIFT = np.array([300.0, 0, 50])

SLAB = """
sample = "slab"
density = "1060kg/m^3"
gravity = true
[body]
slab = "20mm"
width = "60mm"
edge = "6mm"
[[probing]]
recording = "press"
radius = "5mm"
probe = { file = "probe.csv" }
force = { file = "force.csv", noise = "2 mN" }
markers = { file = "markers.csv", noise = "0.1 mm" }
"""


def csv(path, names, *columns):
    rows = np.concatenate([np.asarray(c).reshape(len(T), -1) for c in columns], axis=1)
    path.write_text(names + "\n" + "".join(",".join(f"{v:.6f}" for v in row) + "\n" for row in rows))


@pytest.fixture
def lab(tmp_path):
    """A folder with the four files of a press on a slab, in the body's own frame."""
    csv(tmp_path / "probe.csv", "time (s),x (mm),y (mm),z (mm)", T, CENTRE)
    csv(tmp_path / "force.csv", "time (s),Fx (N),Fy (N),Fz (N)", T, FORCE)
    names = ",".join(f"m{k}_{a} (mm)" for k in range(4) for a in "xyz")
    csv(tmp_path / "markers.csv", f"time (s),{names}", T, np.broadcast_to(MARKS, (41, 4, 3)))
    (tmp_path / "probe.toml").write_text(SLAB)
    return tmp_path


def test_one_command_makes_a_recording_file(lab):
    assert main(["import", str(lab / "probe.toml")]) == 0
    sample = read(lab / "probe.h5")
    press = sample.recordings["press"]
    np.testing.assert_allclose(press.inputs["probe/position"], 1e-3 * CENTRE, atol=1e-9)
    np.testing.assert_allclose(press.channels["force"].values, FORCE, atol=1e-6)
    np.testing.assert_allclose(press.channels["markers"].values[0], 1e-3 * MARKS, atol=1e-9)
    assert press.channels["markers"].noise_std == pytest.approx(1e-4)
    assert sample.gravity == (0.0, 0.0, -9.80665)
    np.testing.assert_allclose(np.ptp(sample.geometry.points, axis=0), [0.06, 0.06, 0.02])
    assert main(["import", str(lab / "probe.toml")]) == 2, "it is there already"


def test_another_frame_is_brought_to_the_body(lab):
    there = lambda x: x @ TURN.T + SHIFT  # noqa: E731
    csv(lab / "probe.csv", "time (s),x (mm),y (mm),z (mm)", T, there(CENTRE))
    csv(lab / "force.csv", "time (s),Fx (N),Fy (N),Fz (N)", T, (FORCE + [0.1, 0, 0]) @ TURN.T)
    names = ",".join(f"m{k}_{a} (mm)" for k in range(4) for a in "xyz")
    csv(lab / "markers.csv", f"time (s),{names}", T, there(np.broadcast_to(MARKS, (41, 4, 3))))
    points = np.array([[0.0, 0, 0], [30, 0, 0], [0, 30, 5]])
    registration = f'[registration]\nunit = "mm"\nmoving = {there(points).tolist()}\ntarget = {points.tolist()}\n'
    (lab / "probe.toml").write_text(SLAB + registration)
    press = probing_sample(lab / "probe.toml").recordings["press"]
    np.testing.assert_allclose(press.inputs["probe/position"], 1e-3 * CENTRE, atol=1e-9)
    np.testing.assert_allclose(press.channels["markers"].values[0], 1e-3 * MARKS, atol=1e-9)
    np.testing.assert_allclose(press.channels["force"].values, FORCE + [0.1, 0, 0], atol=1e-6)


def test_a_surface_is_filled_and_all_is_lifted_onto_the_support(lab):
    block = trimesh.creation.box((60, 60, 20))  # from z = -10 to 10
    block.export(lab / "block.stl")
    lowered = SLAB.replace(
        'slab = "20mm"\nwidth = "60mm"\nedge = "6mm"', 'surface = "block.stl"\nunit = "mm"\nedge = "12mm"'
    )
    (lab / "probe.toml").write_text(lowered)
    csv(lab / "probe.csv", "time (s),x (mm),y (mm),z (mm)", T, CENTRE - [0, 0, 10])
    sample = probing_sample(lab / "probe.toml")
    assert sample.geometry.cell_type == "tetra"
    x = sample.geometry.points[sample.geometry.cells]
    volume = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])).sum() / 6
    assert volume == pytest.approx(0.06 * 0.06 * 0.02, rel=0.01)
    assert sample.geometry.points[:, 2].min() == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(sample.recordings["press"].inputs["probe/position"], 1e-3 * CENTRE, atol=1e-6)


def test_a_cloud_with_its_thickness(lab):
    u = np.linspace(-1, 1, 25)
    x, y = (30 * v.ravel() for v in np.meshgrid(u, u))
    keep = x**2 + y**2 < 30**2
    z = 5 - (x**2 + y**2) / 300
    rows = "".join(f"{a:.3f} {b:.3f} {c:.3f}\n" for a, b, c in zip(x[keep], y[keep], z[keep]))
    (lab / "cloud.xyz").write_text(rows)
    body = 'cloud = "cloud.xyz"\nunit = "mm"\nthickness = "20mm"\nedge = "8mm"'
    (lab / "probe.toml").write_text(SLAB.replace('slab = "20mm"\nwidth = "60mm"\nedge = "6mm"', body))
    made = probing_sample(lab / "probe.toml").geometry
    assert made.cell_type == "hexahedron"
    assert made.points[:, 2].max() == pytest.approx(0.02, rel=0.02)
    assert made.surface_points[:, 2].max() == pytest.approx(0.02)


def test_markers_of_motion_capture_and_of_image_correlation(lab):
    vendor = Path(__file__).parent / "vendor"
    capture, dic = vendor / "c3d-qualisys/beam_load101_V2_a.c3d", vendor / "dice-full-field/DICe_solution_0.txt.gz"
    spec = f'{{ file = "{capture}", noise = "0.1mm" }}'
    (lab / "probe.toml").write_text(SLAB.replace('{ file = "markers.csv", noise = "0.1 mm" }', spec))
    markers = probing_sample(lab / "probe.toml").recordings["press"].channels["markers"]
    np.testing.assert_allclose(markers.values[0, 0], [0.072858, 0.030468, 0.073172], atol=5e-7)
    spec = f'{{ file = ["{dic}"], rate = "1Hz", scale = "0.05mm", every = 10, noise = "0.1mm" }}'
    (lab / "probe.toml").write_text(SLAB.replace('{ file = "markers.csv", noise = "0.1 mm" }', spec))
    markers = probing_sample(lab / "probe.toml").recordings["press"].channels["markers"]
    assert markers.values.shape == (2, 98, 3)
    np.testing.assert_allclose(markers.values[0, 0], [46 * 5e-5, 366 * 5e-5, 0])


def test_an_indentation_table_on_a_slab(lab):
    rows = "".join(f"{t},{max(0, f):.4f},{f:.4f}\n" for t, f in zip(T, FORCE[:, 2]))
    (lab / "indent.csv").write_text("time (s),depth (mm),force (N)\n" + rows)
    argv = ["import", str(lab / "indent.csv"), "--experiment", "indentation", "--radius", "5mm"]
    assert main(argv) == 0
    (lab / "probe.toml").write_text('[body]\nslab = "20mm"\nedge = "5mm"\n[[probing]]\ntable = "indent.toml"\n')
    assert main(["import", str(lab / "probe.toml")]) == 0
    (press,) = read(lab / "probe.h5").recordings.values()
    assert press.inputs["probe/position"][0, 2] == pytest.approx(0.02 + 0.005)


FAULTS = {
    "no body": ("[body]", "[bdy]", ["bdy", "body"]),
    "two bodies": ('slab = "20mm"', 'slab = "20mm"\nmesh = "a.vtu"', ["mesh and slab"]),
    "no unit": ('slab = "20mm"', 'surface = "a.stl"', ["body.unit"]),
    "no radius": ('radius = "5mm"\n', "", ["probing.radius"]),
    "key": ("radius =", "radus =", ["'radus'", "'radius'"]),
    "file": ('"force.csv"', '"forces.csv"', ["forces.csv", "no such file"]),
    "column": ('file = "probe.csv"', 'file = "probe.csv", columns = ["x", "y", "zz"]', ["'zz'"]),
    "wrong unit": ('file = "probe.csv"', 'file = "probe.csv", unit = "N"', ["'N'", "'m'"]),
    "gravity": ("gravity = true", 'gravity = "down"', ["gravity", "three numbers"]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_named(fault, lab):
    old, new, words = FAULTS[fault]
    (lab / "probe.toml").write_text(SLAB.replace(old, new))
    with pytest.raises(InputError) as error:
        probing_sample(lab / "probe.toml")
    assert all(word in str(error.value) for word in words), error.value


def test_a_probing_side_file_points_to_import(lab, capsys):
    assert main(["inspect", str(lab / "probe.toml")]) == 2
    assert "tissuejax import" in capsys.readouterr().err


def test_the_template_is_toml_that_the_reader_knows(capsys):
    import tomllib

    from tissuejax.mesh.probing_files import PART, WHOLE

    assert main(["import", "--template", "probe"]) == 0
    told = tomllib.loads(capsys.readouterr().out)
    assert set(told) <= set(WHOLE)
    assert set(told["probing"][0]) <= set(PART)


def dice(path, moved):
    """A plane view of two points in pixels, (40, 100) and (60, 100), moved by so much along x."""
    rows = "".join(f"{k},{x},100,{moved},0,0.01\n" for k, x in enumerate((40, 60)))
    path.write_text("*** (DICe)\nSUBSET_ID,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA\n" + rows)


def plane_view(lab, more=""):
    spec = f'{{ file = "f*.txt", rate = "2Hz", scale = "0.1 mm", noise = "0.1 mm"{more} }}'
    (lab / "probe.toml").write_text(SLAB.replace('{ file = "markers.csv", noise = "0.1 mm" }', spec))
    sample = probing_sample(lab / "probe.toml")
    return sample.recordings["press"].channels["markers"], sample.notes


def test_a_first_file_without_displacement_is_the_reference(lab):
    for k in range(3):
        dice(lab / f"f{k}.txt", k)
    markers, notes = plane_view(lab)
    np.testing.assert_allclose(markers.time, [0, 0.5, 1])
    np.testing.assert_allclose(markers.values[:, 0, 0], [4e-3, 4.1e-3, 4.2e-3])
    assert "the first file is the reference" in notes
    dice(lab / "f0.txt", 0.5)
    markers, notes = plane_view(lab)
    np.testing.assert_allclose(markers.time, [0, 0.5, 1, 1.5])
    assert "the reference is the frame at 0 s, and the first file's state that at 0.5 s" in notes


def test_a_plane_view_has_the_height_that_is_told(lab):
    for k in range(3):
        dice(lab / f"f{k}.txt", k)
    markers, notes = plane_view(lab)
    assert not markers.values[..., 2].any()
    assert "they lie at z = 0, where the body stands" in notes
    markers, notes = plane_view(lab, ', z = "20 mm"')
    np.testing.assert_allclose(markers.values[..., 2], 0.02)
    assert "its points are put at z = 20 mm" in notes
    # A camera above, whose y counts downwards, its picture's corner at (-5, 10) mm of the body.
    own = 'unit = "mm", moving = [[0, 0, 0], [10, 0, 0], [0, 10, 0]], target = [[-5, 10, 20], [5, 10, 20], [-5, 0, 20]]'
    markers, notes = plane_view(lab, f", registration = {{ {own} }}")
    np.testing.assert_allclose(markers.values[0], [[-1e-3, 0, 0.02], [1e-3, 0, 0.02]], atol=1e-12)
    assert "z = 0" not in notes
    (lab / "probe.toml").write_text(SLAB.replace('noise = "0.1 mm"', 'noise = "0.1 mm", z = "20 mm"'))
    with pytest.raises(InputError, match="points in space"):
        probing_sample(lab / "probe.toml")


def test_a_surface_with_a_hole_is_refused_in_words_of_its_programs(lab):
    box = trimesh.creation.box((60, 60, 20))
    box.update_faces(np.arange(len(box.faces)) > 0)
    box.export(lab / "open.stl")
    body = 'surface = "open.stl"\nunit = "mm"\nedge = "8mm"'
    (lab / "probe.toml").write_text(SLAB.replace('slab = "20mm"\nwidth = "60mm"\nedge = "6mm"', body))
    with pytest.raises(InputError, match="3 open edges.*MeshLab.*Blender.*Python"):
        probing_sample(lab / "probe.toml")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            '"1060kg/m^3"',
            '"1.06 kg/m^3"',
            "note: density is 1.06 kg/m^3, where soft tissue has about 1000: g/cm^3 read",
        ),
        ("gravity = true", "gravity = [0, 0, 9.81]", "note: gravity [0, 0, 9.81] m/s^2 points upward"),
        ("radius", "radius", ""),
    ],
)
def test_a_slip_of_density_or_gravity_is_remarked(old, new, words, lab, capsys):
    (lab / "probe.toml").write_text(SLAB.replace(old, new))
    assert main(["import", str(lab / "probe.toml")]) == 0
    out = capsys.readouterr().out
    assert words in out
    assert ("note: density" in out or "note: gravity" in out) == bool(words)
    assert main(["inspect", str(lab / "probe.h5")]) == 0
    assert words.removeprefix("note: ") in capsys.readouterr().out


def test_a_word_on_a_test_machine_is_refused_where_there_is_none(lab, capsys):
    main(["import", str(lab / "probe.toml")])
    assert main(["diagnose", str(lab / "probe.h5"), "-e", "neo-hookean", "--rig", "unchecked"]) == 2
    assert "--rig unchecked: in a recording of probing" in capsys.readouterr().err
