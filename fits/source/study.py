"""Every quantitative result of the source's chapters 2 to 4 beside ours: what can be computed here is, in steps kept.

tissuejax study fits/source          about seven minutes; parts that are in result.json are not run again
"""

import json
import runpy
from pathlib import Path

import jax
import numpy as np
from matplotlib.figure import Figure

from tissuejax.storage import write_json, write_text

jax.config.update("jax_enable_x64", True)

COARSE, MIDDLE = (14, 12, 7), (20, 16, 9)
SAGS = ((20, 16, 8), (24, 20, 10))
AT_REST = 0.3  # hourglass stiffness for the weight alone, which strains little
RADII = {"R 5 mm": 5e-3, "R 10 mm": 10e-3}
PUBLISHED = {"a_N": 0.009991, "b_1_m": 373.6, "r_squared": 0.9998}  # eq. 4.14


class Kept:
    """result.json as it grows: each part is worked out once."""

    def __init__(self, folder: Path):
        self.path = folder / "result.json"
        self.parts = json.loads(self.path.read_text()) if self.path.exists() else {}

    def get(self, name: str, work):
        """The part of that name, worked out by `work()` unless it is there."""
        if name not in self.parts:
            self.parts[name] = work()
            write_json(self.path, self.parts)
        return self.parts[name]


def lobe_parts(lobe: dict, kept: Kept) -> None:
    """The settled lobe and the press, on two meshes; the other Ogden forms and reversed gravity on the coarse one."""
    for name, counts in (("coarse", COARSE), ("middle", MIDDLE)):
        shapes = {}

        def shape(counts=counts, shapes=shapes):
            if not shapes:
                shapes["at"] = lobe["settled"](counts)
            return shapes["at"]

        kept.get(f"settled, {name}", lambda shape=shape: lobe["sag"](*shape()))
        for radius, r in RADII.items():
            kept.get(f"pressed, {name}, {radius}", lambda shape=shape, r=r: lobe["pressed"](*shape(), r))
    for counts in SAGS:
        name = f"sag, {' x '.join(map(str, counts))}"
        kept.get(name, lambda counts=counts: sagging(lobe, counts))
    for form in lobe["FORMS"][1:]:
        kept.get(f"settled, coarse, {form}", lambda form=form: settled_or_not(lobe, form))
    kept.get("gravity reversed and applied again", lambda: lobe["reversed_gravity"](COARSE))


def sagging(lobe: dict, counts: tuple[int, int, int]) -> dict:
    """Sag under the weight alone."""
    geometry, u = lobe["settled"](counts, hourglass=AT_REST)
    return lobe["sag"](geometry, u) | {"hexes": len(geometry.cells)}


def settled_or_not(lobe: dict, form: str) -> dict:
    """Sag in another Ogden form, or the sentence why there is none."""
    from tissuejax.errors import TissueError

    try:
        return lobe["sag"](*lobe["settled"](COARSE, form))
    except TissueError as error:
        return {"no answer": str(error)}


def draw(kept: Kept, lobe: dict) -> Figure:
    """Force over depth of the pressed lobe, and eq. 4.14."""
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    x = np.linspace(0, 15.5, 100)
    axes.semilogy(x, PUBLISHED["a_N"] * np.exp(PUBLISHED["b_1_m"] * 1e-3 * x), "k", label="eq. 4.14")
    for i, radius in enumerate(RADII):
        for name, line in (("coarse", "--"), ("middle", "-")):
            part = kept.parts.get(f"pressed, {name}, {radius}")
            if part:
                force = np.maximum(part["force_N"], 1e-4)
                axes.semilogy(part["depth_mm"], force, line, color=f"C{i}", label=f"{radius}, {part['hexes']} hexes")
    axes.set_xlabel("depth (mm)")
    axes.set_ylabel("force (N)")
    axes.set_ylim(5e-3, 10)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8)
    return figure


def main(folder: Path) -> str:
    """Run what is missing, write result.json, table.md and the figure; the answer in a sentence."""
    kept, lobe = Kept(folder), runpy.run_path(str(folder / "lobe.py"))
    table = runpy.run_path(str(folder / "table.py"))
    for name, work in table["PARTS"].items():
        kept.get(name, lambda work=work: work(folder))
    lobe_parts(lobe, kept)
    for name, part in list(kept.parts.items()):
        if name.startswith("pressed"):
            kept.get(f"eq. 4.14, {name}", lambda part=part: lobe["exponential"](part["depth_mm"], part["force_N"]))
    rows = table["rows"](kept.parts)
    write_text(folder / "table.md", table["text"](rows))
    (folder / "figures").mkdir(exist_ok=True)
    draw(kept, lobe).savefig(folder / "figures" / "lobe.png", dpi=100)
    beside = sum(row.ours != "" for row in rows)
    return f"{beside} of {len(rows)} results of the source stand beside ours; the others say why not"


if __name__ == "__main__":
    print(main(Path(__file__).parent))
