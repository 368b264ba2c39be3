"""A lab's table of a cut with its side file: the same sample as the recording file, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from tissuejax.errors import InputError
from tissuejax.recordings import files
from tissuejax.recordings.cutting_table import foremost

DATA = Path(__file__).parents[2] / "data"
ROWS = "t,x,F,Fz,d\n" + "".join(f"{0.5 * i},{i - 2},{max(0, i - 2) * 0.01},{0.001 * i},4\n" for i in range(20))
SIDE = """
file = "t.csv"
experiment = "cutting"
[columns]
time = { column = "t", unit = "s" }
displacement = { column = "x", unit = "mm" }
force = { column = "F", unit = "N" }
[tissue]
length = "30 mm"
width = "20 mm"
height = "10 mm"
[blade]
thickness = "0.4 mm"
"""
DEEP = SIDE + 'depth = "4 mm"\n'


def put(folder, side, rows=ROWS):
    (folder / "t.csv").write_text(rows)
    (folder / "t.toml").write_text(side)
    return folder / "t.toml"


def test_the_example_table_is_the_example_file():
    table, file = files.read(DATA / "cutting" / "cut.toml"), files.read(DATA / "cut.h5")
    assert list(table.recordings) == list(file.recordings)
    for name, r in table.recordings.items():
        other = file.recordings[name]
        np.testing.assert_allclose(r.inputs["blade/tip"][:, 0], other.inputs["blade/tip"][:, 0], atol=1e-9)
        np.testing.assert_allclose(r.inputs["depth"], other.inputs["depth"], atol=1e-9)
        measured = r.channels["force"], other.channels["force"]
        np.testing.assert_allclose(*(np.asarray(c.values) for c in measured), atol=1e-8)
        assert r.attributes["blade/angle"] == pytest.approx(other.attributes["blade/angle"], abs=0.01)
        assert r.attributes["blade/thickness"] == pytest.approx(other.attributes["blade/thickness"])
    low, high = (np.asarray(table.geometry.points).min(0), np.asarray(table.geometry.points).max(0))
    np.testing.assert_allclose(high - low, [0.04, 0.02, 0.012])


def test_sizes_force_along_the_blade_and_a_straight_edge(tmp_path):
    side = DEEP.replace("[tissue]", 'force_z = { column = "Fz", unit = "N" }\n[tissue]') + 'notch = "3 mm"\n'
    r = files.read(put(tmp_path, side)).recordings["r1"]
    np.testing.assert_allclose(r.channels["force"].values[:, 2], 0.001 * np.arange(20))
    np.testing.assert_allclose(r.inputs["blade/tip"][:, 2], 0.006)
    np.testing.assert_allclose(r.attributes["blade/profile"], [[0, 0], [0, 0.010]])
    assert r.attributes["notch"] == pytest.approx(0.003)


def test_an_edge_from_points_and_from_a_file(tmp_path):
    (tmp_path / "edge.csv").write_text("x,z\n1,0\n1.5,2\n3,5\n")
    for profile in ('{ file = "edge.csv", unit = "mm" }', "{ points = [[1, 0], [1.5, 2], [3, 5]], unit = 'mm' }"):
        r = files.read(put(tmp_path, DEEP + f"profile = {profile}\n")).recordings["r1"]
        np.testing.assert_allclose(r.attributes["blade/profile"], [[0, 0], [0.5e-3, 2e-3], [2e-3, 5e-3]])


def test_an_edge_from_a_picture(tmp_path):
    """A parabola x = -z^2 / 8 mm drawn dark on bright, 20 um a pixel, tip down and to the right."""
    from skimage.io import imsave

    pixel, z = 20e-6, (199 - np.arange(200)) * 20e-6
    front = 5e-3 - z**2 / 8e-3
    picture = 1 / (1 + np.exp(-(np.arange(300) * pixel - front[:, None]) / (0.4 * pixel)))
    imsave(tmp_path / "blade.png", np.round(255 * picture).astype(np.uint8), check_contrast=False)
    r = files.read(put(tmp_path, DEEP + 'profile = { picture = "blade.png", pixel = "20 um" }\n')).recordings["r1"]
    edge = r.attributes["blade/profile"]
    np.testing.assert_allclose(edge[:, 0], -(edge[:, 1] ** 2) / 8e-3, atol=0.2 * pixel)
    with pytest.raises(InputError, match="contrast"):
        foremost(np.full((50, 50), 0.5), pixel)


@pytest.mark.parametrize(
    ("side", "words"),
    [
        (SIDE, ["depth of the cut", "[blade]"]),
        (DEEP.replace('"4 mm"', '"14 mm"'), ["depth", "height"]),
        (DEEP.replace("thickness", "thicknes"), ["thicknes", "thickness"]),
        (DEEP.replace('width = "20 mm"\n', ""), ["tissue.width"]),
        (DEEP.replace('"30 mm"', '"30"'), ["tissue.length", "unit"]),
        (DEEP.replace("displacement", "stretch").replace('unit = "mm" }\nforce', 'unit = "1" }\nforce'), ["stretch"]),
        (DEEP + 'profile = { file = "no.csv", unit = "mm" }\n', ["blade.profile", "no.csv"]),
        (DEEP + "profile = { points = [[0, 0], [1, 0]], unit = 'mm' }\n", ["rising z"]),
        (DEEP + 'profile = { picture = "blade.png" }\n', ["pixel"]),
    ],
)
def test_what_is_refused(side, words, tmp_path):
    with pytest.raises(InputError) as refused:
        files.read(put(tmp_path, side))
    for word in words:
        assert word in str(refused.value), str(refused.value)
    assert refused.value.exit_code == 2


def test_import_writes_a_side_file_with_lines_to_fill_in(tmp_path, capsys):
    from tissuejax.cli import main

    (tmp_path / "cut.csv").write_text(ROWS.replace("t,x,F,Fz,d", "time_s,displacement_mm,force_N,Fz_N,depth_mm"))
    assert main(["import", str(tmp_path / "cut.csv"), "--experiment", "cutting"]) == 2
    side = tmp_path / "cut.toml"
    with pytest.raises(InputError, match=r"tissue.length: found \"\?\""):
        files.read(side)
    text = side.read_text()
    for key, value in (("length", "30 mm"), ("width", "20 mm"), ("height", "10 mm"), ("thickness", "0.4 mm")):
        text = text.replace(f'{key} = "?"', f'{key} = "{value}"')
    side.write_text(text.replace('depth = "?"', 'depth = "4 mm"'))
    r = files.read(side).recordings["r1"]
    np.testing.assert_allclose(r.inputs["blade/tip"][:, 0], (np.arange(20) - 2) * 1e-3)
    np.testing.assert_allclose(r.channels["force"].values[:, 0], np.maximum(0, np.arange(20) - 2) * 0.01)
