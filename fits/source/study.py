"""Every quantitative result of the source's chapters 2 to 4 beside ours: what can be computed here is, in steps kept.

tissuejax study fits/source          twenty minutes or so; parts that the same code made are kept

PARTS="cylinder;breathing" in the environment: only parts whose names begin so (and such as are missing); PARTS=none
draws table and figures of what is there.
"""

import runpy
from collections.abc import Callable
from pathlib import Path

import jax
import numpy as np
from matplotlib.figure import Figure

from tissuejax.cache import source
from tissuejax.cache.parts import Parts
from tissuejax.storage import write_text

jax.config.update("jax_enable_x64", True)

STUDIES = source.ROOT.parent / "fits"  # of the checkout: a copy of this folder reads its neighbours there
COARSE, MIDDLE, FINE = (14, 12, 7), (20, 16, 9), (28, 22, 12)
MESHES = {"coarse": COARSE, "middle": MIDDLE, "fine": FINE}
SOFTER = (1.0, 3.0)  # hourglass stiffness of the press beside the one it takes, for the ball of 10 mm
SITE_MESH = (16, 16, 8)
SAGS = ((20, 16, 8), (24, 20, 10))
AT_REST = 0.3  # hourglass stiffness for the weight alone, which strains little
RADII = {"R 5 mm": 5e-3, "R 10 mm": 10e-3}
PUBLISHED = {"a_N": 0.009991, "b_1_m": 373.6, "r_squared": 0.9998}  # eq. 4.14
CYLINDER_ERROR = 3e-4  # N, 4.1.1.1


def needed(folder: Path) -> dict[str, tuple[Path, ...]]:
    """Files beside the package that each kind of part depends on."""
    liver, bench = STUDIES / "in-vivo-liver", source.ROOT.parent / "tests" / "bench" / "results"
    scripts = ("study", "lobe", "cylinder", "deep", "markers", "breathing", "table", "states")
    study, lobe, cylinder, deep, markers, breathing, table, states = (folder / f"{n}.py" for n in scripts)
    rig, fitted = liver / "study.py", liver / "result.json"
    return {
        "table": (table, fitted, bench / "step.json", bench / "contact.json"),
        "lobe": (study, lobe),
        "cylinder": (study, cylinder),
        "deep": (study, deep, rig),
        "markers": (study, markers, rig, fitted),
        "breathing": (study, breathing, rig),
        "states": (states, lobe),
    }


def lobe_parts(lobe: dict, kept: Parts, needs: tuple[Path, ...]) -> None:
    """The settled lobe and the press, on three meshes; the other Ogden forms and reversed gravity on the coarse one."""
    for name, counts in MESHES.items():
        shapes = {}

        def shape(counts=counts, shapes=shapes):
            if not shapes:
                shapes["at"] = lobe["settled"](counts)
            return shapes["at"]

        def pressed(part, r, shape=shape, **options):
            kept.get(f"pressed, {part}", lambda: answered(lambda: lobe["pressed"](*shape(), r, **options)), needs)

        kept.get(f"settled, {name}", lambda shape=shape: lobe["sag"](*shape()), needs)
        for radius, r in RADII.items():
            pressed(f"{name}, {radius}", r)
        for h in SOFTER if name != "coarse" else ():
            pressed(f"{name}, R 10 mm, hourglass {h:g}", RADII["R 10 mm"], hourglass=h)
    for counts in SAGS:
        name = f"sag, {' x '.join(map(str, counts))}"
        kept.get(name, lambda counts=counts: sagging(lobe, counts), needs)
    for form in lobe["FORMS"][1:]:
        kept.get(
            f"settled, coarse, {form}",
            lambda form=form: answered(lambda: lobe["sag"](*lobe["settled"](COARSE, form))),
            needs,
        )
    kept.get("gravity reversed and applied again", lambda: lobe["reversed_gravity"](COARSE), needs)


def cylinder_parts(cylinder: dict, kept: Parts, needs: tuple[Path, ...]) -> None:
    """The compressed cylinder of 4.1.1.1, each law with each bulk modulus."""
    for law in cylinder["LAWS"]:
        for bulk in cylinder["BULKS"]:
            name = f"cylinder, {law}, K {1e-6 * bulk:g} MPa"
            kept.get(name, lambda law=law, bulk=bulk: cylinder["compressed"](law, bulk), needs)


def site_parts(folder: Path, kept: Parts, needs: dict[str, tuple[Path, ...]]) -> None:
    """The synthetic sites of fits/in-vivo-liver: pressed to 3 N, their errors by marker, and one that breathes."""
    deep, markers, breathing = (runpy.run_path(str(folder / f"{n}.py")) for n in ("deep", "markers", "breathing"))

    def study() -> dict:
        return runpy.run_path(str(STUDIES / "in-vivo-liver" / "study.py"))

    for name in deep["DEEPEST"]:
        kept.get(f"to 3 N, {name}", lambda name=name: deep["site"](study(), name, SITE_MESH), needs["deep"])
        kept.get(f"by marker, {name}", lambda name=name: markers["site"](study(), name), needs["markers"])
    kept.get("breathing", lambda: breathing["breathing"](study()), needs["breathing"])


def sagging(lobe: dict, counts: tuple[int, int, int]) -> dict:
    """Sag under the weight alone."""
    geometry, u = lobe["settled"](counts, hourglass=AT_REST)
    return lobe["sag"](geometry, u) | {"hexes": len(geometry.cells)}


def answered(work: Callable[[], dict]) -> dict:
    """What it gives, or the sentence why there is nothing."""
    from tissuejax.errors import TissueError

    try:
        return work()
    except TissueError as error:
        return {"no answer": str(error)}


def draw_lobe(kept: Parts) -> Figure:
    """Force over depth of the pressed lobe, and eq. 4.14."""
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    x = np.linspace(0, 15.5, 100)
    axes.semilogy(x, PUBLISHED["a_N"] * np.exp(PUBLISHED["b_1_m"] * 1e-3 * x), "k", label="eq. 4.14")
    for i, radius in enumerate(RADII):
        for name, line in (("coarse", ":"), ("middle", "--"), ("fine", "-")):
            part = kept.parts.get(f"pressed, {name}, {radius}")
            if part and "force_N" in part:
                force = np.maximum(part["force_N"], 1e-4)
                axes.semilogy(part["depth_mm"], force, line, color=f"C{i}", label=f"{radius}, {part['hexes']} hexes")
    axes.set_xlabel("depth (mm)")
    axes.set_ylabel("force (N)")
    axes.set_ylim(5e-3, 10)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8)
    return figure


def draw_cylinder(kept: Parts, cylinder: dict) -> Figure:
    """Force over stretch beside eq. 4.11, and the distance between them beside the source's greatest."""
    figure = Figure(figsize=(8.5, 3.6), layout="constrained")
    force, error = figure.subplots(1, 2)
    for i, law in enumerate(cylinder["LAWS"]):
        for bulk, line in zip(cylinder["BULKS"], ("--", "-"), strict=True):
            part = kept.parts[f"cylinder, {law}, K {1e-6 * bulk:g} MPa"]
            apart = np.abs(np.subtract(part["force_N"], part["eq_4.11_N"]))
            label = f"{law}, K {1e-6 * bulk:g} MPa"
            error.semilogy(part["stretch"], apart, line, color=f"C{i}", label=label)
        force.plot(part["stretch"], part["eq_4.11_N"], "k", linewidth=0.8, label="eq. 4.11" if i == 0 else None)
        force.plot(part["stretch"], part["force_N"], "o", color=f"C{i}", markersize=3, label=label)
    error.axhline(CYLINDER_ERROR, color="k", linewidth=0.8, linestyle=":", label="source's greatest")
    for axes, what in ((force, "force (N)"), (error, "distance from eq. 4.11 (N)")):
        axes.set(xlabel="stretch", ylabel=what)
        axes.invert_xaxis()
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, fontsize=7)
    return figure


def draw_sites(kept: Parts) -> Figure:
    """Force over depth until 3 N: the law in vivo that stands for the tissue, and the ex vivo law."""
    figure = Figure(figsize=(8.5, 3.2), layout="constrained")
    parts = {name.split(", ")[1]: part for name, part in kept.parts.items() if name.startswith("to 3 N")}
    for ax, (name, part) in zip(figure.subplots(1, 3, sharey=True), parts.items(), strict=True):
        for key, label, color in (("force_N", "law in vivo", "C0"), ("ex_vivo_N", "law ex vivo", "C1")):
            ax.plot(part["depth_mm"][: len(part[key])], part[key], color=color, linewidth=1.2, label=label)
        ax.axhline(3.0, color="k", linewidth=0.8, linestyle=":")
        ax.set(title=name, xlabel="depth (mm)", ylim=(0, 4))
        ax.title.set_fontsize(9)
        ax.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel("force (N)")
    figure.axes[0].legend(frameon=False, fontsize=7)
    return figure


def draw_breathing(part: dict) -> Figure:
    """Height of a marker near the probe and force, over time."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    marker, force = figure.subplots(2, 1, sharex=True)
    height = np.array(part["marker_height_mm"])
    marker.plot(part["time_s"], height - height[0], "C0")
    marker.set_ylabel("marker's height (mm)")
    force.plot(part["force_time_s"], part["force_N"], "C1")
    force.set(xlabel="time (s)", ylabel="force (N)")
    for axes in (marker, force):
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def main(folder: Path) -> str:
    """Run what is missing, write result.json, table.md and the figure; the answer in a sentence."""
    needs = needed(folder)
    kept = Parts(folder / "result.json", {file for files in needs.values() for file in files})
    lobe, cylinder, table = (runpy.run_path(str(folder / f"{n}.py")) for n in ("lobe", "cylinder", "table"))
    for name, work in table["PARTS"].items():
        kept.get(name, work, needs["table"])
    lobe_parts(lobe, kept, needs["lobe"])
    for name, part in list(kept.parts.items()):
        if name.startswith("pressed") and "force_N" in part:
            way = part["depth_mm"], part["force_N"]
            kept.get(f"eq. 4.14, {name}", lambda way=way: lobe["exponential"](*way), needs["lobe"], of=way)
    cylinder_parts(cylinder, kept, needs["cylinder"])
    site_parts(folder, kept, needs)
    played = runpy.run_path(str(folder / "states.py"))["main"]
    kept.get("forty states", played, needs["states"])
    rows = table["rows"](kept.parts)
    write_text(folder / "table.md", table["text"](rows))
    (folder / "figures").mkdir(exist_ok=True)
    pictures = {
        "lobe": draw_lobe(kept),
        "cylinder": draw_cylinder(kept, cylinder),
        "sites": draw_sites(kept),
        "breathing": draw_breathing(kept.parts["breathing"]),
    }
    for name, picture in pictures.items():
        picture.savefig(folder / "figures" / f"{name}.png", dpi=100)
    beside = sum(row.ours != "" for row in rows)
    answer = f"{beside} of {len(rows)} results of the source stand beside ours; the others say why not"
    return ". ".join(filter(None, (answer, kept.said())))


if __name__ == "__main__":
    print(main(Path(__file__).parent))
