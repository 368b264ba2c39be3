"""A lab's table of a cut: what its side file says beyond the columns, and the recording and the body made of both.

experiment = "cutting"
[columns]
time         = { column = "t", unit = "s" }
displacement = { column = "x", unit = "mm" }      # of the tip along the cut, from where the tissue begins
force        = { column = "Fx", unit = "N" }      # along the cut, either sign
force_z      = { column = "Fz", unit = "N" }      # along the blade, optional
depth        = { column = "deep", unit = "mm" }   # of the cut, optional; or one number in [blade]
[tissue]
length = "40 mm"                                  # along the cut
width  = "20 mm"                                  # across it; the blade runs in the middle
height = "12 mm"
[blade]
thickness = "0.365 mm"
angle     = "28.4 deg"                            # between the bevels, 30 degrees if not given
depth     = "9 mm"
notch     = "10 mm"                               # optional: how far the cut reached before (a second pass)
profile   = { file = "edge.csv", unit = "mm" }    # x and z of the edge from the tip up; or { points = [[0, 0],
                                                  # [2, 10]], unit = "mm" }, or { picture = "blade.png",
                                                  # pixel = "20 um" }; a straight, upright edge if not given
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError, unknown
from tissuejax.recordings import checks
from tissuejax.recordings import conversions as convert
from tissuejax.recordings.images import contrasted
from tissuejax.recordings.recording import Channel, Geometry, Recording
from tissuejax.units import factor, quantity

TISSUE = ("length", "width", "height")
BLADE = {"thickness": "m", "angle": "rad", "depth": "m", "notch": "m"}
ROWS = 3  # of a picture that an edge has to cross


@dataclass(frozen=True)
class Setup:
    """Tissue and blade as a side file gives them, SI; `profile` as written, resolved beside `folder`."""

    tissue: Mapping[str, float]
    blade: Mapping[str, float]
    profile: Mapping[str, object] | None = None


def setup_from(tissue: Mapping[str, object], blade: Mapping[str, object]) -> Setup:
    """Tables [tissue] and [blade] checked.

    Raises:
        InputError: an unknown key, a missing size or thickness, a wrong unit.
    """
    for key in tissue:
        if key not in TISSUE:
            raise unknown("size in [tissue]", key, TISSUE)
    for key in blade:
        if key not in (*BLADE, "profile"):
            raise unknown("key in [blade]", key, (*BLADE, "profile"))
    for table, name, needed in ((tissue, "tissue", TISSUE), (blade, "blade", ("thickness",))):
        for key in needed:
            if key not in table:
                raise InputError(f'{name}.{key}: found nothing, expected a length, e.g. "12 mm"')
    for key, value in (
        (f"{t}.{k}", v) for t, table in (("tissue", tissue), ("blade", blade)) for k, v in table.items()
    ):
        if value == "?":
            raise InputError(f'{key}: found "?", expected a length: measure it and write it here, e.g. "12 mm"')
    sizes = {k: quantity(v, "m", f"tissue.{k}") for k, v in tissue.items()}
    given = {k: quantity(v, BLADE[k], f"blade.{k}") for k, v in blade.items() if k in BLADE}
    for key, value in (sizes | {k: v for k, v in given.items() if k != "notch"}).items():
        if not value > 0:
            raise InputError(f"{key}: found {value:g}, expected a size above zero")
    profile = blade.get("profile")
    if profile is not None and not isinstance(profile, dict):
        raise InputError(f"blade.profile: found {profile!r}, expected {{ file, points or picture = ... }}")
    return Setup(sizes, given, profile)


def body(setup: Setup) -> Geometry:
    """The tissue as one block: x along the cut from 0, y across it, z up, the bottom held."""
    length, width, height = (setup.tissue[k] for k in TISSUE)
    points = np.array([[x, y, z] for z in (0, height) for y in (-width / 2, width / 2) for x in (0, length)], float)
    return Geometry(points, np.array([[0, 1, 3, 2, 4, 5, 7, 6]]), "hexahedron", np.arange(4))


def cut_from(
    setup: Setup, time: Float[np.ndarray, " n"], values: Mapping[str, np.ndarray], noise: str, side: Path, name: str,
    place: str,
) -> Recording:  # fmt: skip
    """The recording of one cut.

    Args:
        values: displacement, force, and where recorded force_z and depth, SI. noise: of the force, as text.
        side: the side file, beside which a profile is looked for.

    Raises:
        InputError: other quantities than those, no depth, a depth beyond the tissue, an edge that is none.
    """
    if "displacement" not in values or "force" not in values:
        found = ", ".join(values)
        raise checks.refusal(place, "columns for cutting", found, "displacement (of the blade) and force")
    height, deep = setup.tissue["height"], values.get("depth")
    if deep is None:
        if "depth" not in setup.blade:
            raise checks.refusal(place, "depth of the cut", "nothing", 'a column, or depth = "5 mm" in [blade]')
        deep = np.full(len(time), setup.blade["depth"])
    if np.max(deep) > height * (1 + 1e-9) or np.min(deep) < 0:
        found = f"{1e3 * np.min(deep):.3g} to {1e3 * np.max(deep):.3g} mm"
        raise checks.refusal(place, "depth of the cut", found, f"0 to the tissue's height, {1e3 * height:.3g} mm")
    x, zero = values["displacement"], np.zeros(len(time))
    force = np.stack([values["force"], zero, values.get("force_z", zero)], 1)
    std = convert.noise_of(time, values["force"]) if noise == "estimate" else quantity(noise, "N", "noise.force")
    attributes = {
        "blade/thickness": setup.blade["thickness"], "blade/profile": edge(setup, side),
    }  # fmt: skip
    if "angle" in setup.blade:
        attributes["blade/angle"] = float(np.degrees(setup.blade["angle"]))
    if "notch" in setup.blade:
        attributes["notch"] = setup.blade["notch"]
    inputs = {"blade/time": time, "blade/tip": np.stack([x, zero, height - deep], 1), "depth": deep}
    return Recording(name, "cutting", inputs, {"force": Channel(time, force, "N", std)}, attributes)


def edge(setup: Setup, side: Path) -> Float[np.ndarray, "p 2"]:
    """x and z of the edge from the tip up, m.

    Raises:
        InputError: no such file, no two columns, heights that do not rise, a picture without a blade.
    """
    given = setup.profile
    if given is None:
        return np.array([[0.0, 0.0], [0.0, setup.tissue["height"]]])
    where = "blade.profile"
    if "picture" in given:
        if set(given) != {"picture", "pixel"}:
            raise InputError(f'{where}: a picture needs its scale and nothing else: pixel = "20 um"')
        path = side.parent / str(given["picture"])
        if not path.is_file():
            raise InputError(f"{where}: no file {path}")
        from skimage.io import imread

        return foremost(imread(path), quantity(given["pixel"], "m", f"{where}.pixel"))
    if set(given) - {"unit"} not in ({"file"}, {"points"}) or "unit" not in given:
        raise InputError(f'{where}: expected file or points, and their unit, e.g. {{ file = "edge.csv", unit = "mm" }}')
    if "file" in given:
        path = side.parent / str(given["file"])
        if not path.is_file():
            raise InputError(f"{where}: no file {path}")
        try:
            table = np.genfromtxt(path, delimiter=",", comments="#")
        except ValueError as error:
            raise InputError(f"{where}: {path} is no table of two columns ({error})") from error
        table = table[np.isfinite(table).all(1)] if table.ndim == 2 else table  # a line of names
    else:
        table = np.asarray(given["points"], float)
    if table.ndim != 2 or table.shape[1] != 2 or len(table) < 2 or not (np.diff(table[:, 1]) > 0).all():
        raise InputError(f"{where}: expected two or more rows of x and z with rising z, from the tip of the edge up")
    return (table - table[0]) * factor(str(given["unit"]), "m")


def foremost(image: Float[np.ndarray, "..."], pixel: float) -> Float[np.ndarray, "p 2"]:
    """The edge of a blade in a picture from the side: cutting towards the right, tip down, dark before a bright ground.

    In every row the last place (from the left) where brightness passes half, between pixels (Lister 2012, fig. 3.8, by
    hand there). The tip is the lowest row that the blade is in.

    Args:
        image: rows from the top down, grey or RGB(A). pixel: size of one, m.

    Raises:
        InputError: no contrast, or no blade in fewer than `ROWS` rows.
    """
    grey = contrasted(image[..., :3] if image.ndim == 3 else image)
    found = []
    for row in range(len(grey) - 1, -1, -1):
        dark = np.flatnonzero(grey[row] < 0.5)
        if len(dark) and dark[-1] + 1 < grey.shape[1]:
            k = dark[-1]
            a, b = grey[row, k], grey[row, k + 1]
            found.append((k + (0.5 - a) / max(b - a, 1e-12), len(grey) - 1 - row))
    if len(found) < ROWS:
        raise InputError(f"blade.profile: a blade in {len(found)} rows of the picture; expected a dark blade, tip down")
    edge = np.array(found, float)
    return (edge - edge[0]) * pixel
