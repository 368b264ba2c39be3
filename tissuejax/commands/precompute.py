"""`tissuejax precompute`: tabulate what a model's probing predicts, with its measured error."""

import argparse
import shutil
from pathlib import Path
from typing import ClassVar

import numpy as np

from tissuejax.commands.arguments import positive
from tissuejax.commands.command import Command, Reply
from tissuejax.commands.tissue_given import add_tissue, tissue
from tissuejax.errors import InputError, NotConverged
from tissuejax.progress import for_terminal
from tissuejax.surrogate import store
from tissuejax.surrogate.places import Box, whole_top
from tissuejax.surrogate.precompute import BOX_MESH, TOP_MESH, precompute
from tissuejax.surrogate.site_mesh import Grid


class Precompute(Command):
    """Sites by statics of the full model, tables through them, one file."""

    name: ClassVar[str] = "precompute"
    order: ClassVar[int] = 44
    summary: ClassVar[str] = "tabulate the force and shape under a probe, to be played at the speed of a hand"
    teaches: ClassVar[str] = """
A fit becomes a surrogate: force and shape under the probe at every place of a box on the organ's top and every depth
below it, tabulated from static equilibria of the full model, with relaxation, friction and adhesion on top. The file
says how wrong it is: against the full model at places it was not made from, and how wrong the full model's own mesh is.

  tissuejax precompute out/fit --sample organ.h5 --reach 12 --depth 7 --out organ.play.h5
  tissuejax precompute out/fit --sample organ.h5 --site 12,8 --reach 12 --depth 7 --error 1
  tissuejax precompute --slab 60x60x20 --radius 4.75 --energy reduced-polynomial-2 --value energy.C10=645 \\
      --value energy.C20=500 --value volumetric.K=20000 --reach 6 --depth 7 --out slab.play.h5
  tissuejax precompute out/fit --sample organ.h5 --all --depth 5

Finished sites are kept beside the file until it is written: a run that was stopped goes on from there when the same
command is given again. Softening, a moving or sliding base and escaping fluid can't be tabulated: use
`tissuejax play --direct`. Then: `tissuejax play FILE`.
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """The tissue, the box and --out."""
        add_tissue(parser)
        parser.add_argument("--site", metavar="X,Y", help="middle of the box, mm (default: where was probed)")
        parser.add_argument("--reach", type=float, default=12.0, metavar="MM", help="from the middle (default 12)")
        parser.add_argument("--all", action="store_true", help="the largest rectangle on the top instead of a box")
        parser.add_argument("--depth", type=float, default=7.0, metavar="MM", help="below first contact (default 7)")
        parser.add_argument("--error", type=float, metavar="PERCENT", help="add sites until held-out errors are below")
        parser.add_argument("--spacing", type=float, default=6.0, metavar="MM", help="between first sites (default 6)")
        parser.add_argument("--depths", type=int, default=8, metavar="N", help="depths at each site (default 8)")
        parser.add_argument("--mesh", metavar="AxBxC", help="elements of a site (default 22x22x8; with --all 16x16x6)")
        parser.add_argument("--processes", type=int, default=2, metavar="N", help="side by side (default 2)")
        parser.add_argument("--out", "-o", type=Path, metavar="FILE", help="default: out/SAMPLE.play.h5")

    def run(self, given: argparse.Namespace) -> Reply:
        """Tabulate and write."""
        for name in ("reach", "depth", "spacing"):
            if not 0 < getattr(given, name) < np.inf:
                raise InputError(f"--{name} {getattr(given, name):g}: wanted is a length over 0, in mm")
        positive(given.processes, "--processes")
        what = tissue(given)
        matter = what.matter
        if given.all:
            low, high = whole_top(matter.lobe, matter.radius)
        else:
            middle = what.site if given.site is None else place_of(given.site)
            low, high = middle - given.reach / 1e3, middle + given.reach / 1e3
        if given.depths < 4:
            raise InputError(f"--depths {given.depths}: wanted are at least 4")
        counts = tuple(max(2, int(np.ceil(1e3 * w / given.spacing - 1e-6)) + 1) for w in high - low)
        box = Box(low, high, given.depth / 1e3, counts, given.depths)
        name = "slab" if what.sample is None else what.sample.name
        out = given.out or Path("out") / f"{name}.play.h5"
        keep = out.with_name(out.name + ".sites")
        wanted = None if given.error is None else given.error / 100
        usual = TOP_MESH if given.all else BOX_MESH
        grid = Grid(counts_of(given.mesh) if given.mesh else usual, matter.radius)
        try:
            made = precompute(matter, box, grid, wanted, keep, for_terminal(), given.processes)
        except NotConverged as fault:
            kept = (
                f"finished sites are kept in {keep}, for a command like this one"
                if keep.is_dir()
                else "no site is done"
            )
            raise InputError(f"{fault}; {kept}") from fault
        made.record["sample"] = name
        store.write(made, out)
        shutil.rmtree(keep, ignore_errors=True)
        record = made.record | {"file": str(out), "bytes": out.stat().st_size}
        return Reply(
            record, "\n".join([*described(made.record), f"file     {out} ({out.stat().st_size / 1e6:.1f} MB)"])
        )


def described(record: dict) -> list[str]:
    """What a surrogate is and how wrong, in lines."""
    box, wrong, own = record["box"], record["error"], record["numerical"]
    wide = [1e3 * (b - a) for a, b in zip(box["low_m"], box["high_m"])]
    lines = [
        f"{record['model']['energy']} with {', '.join(record['model']['effects']) or 'no effects'}: "
        f"{wide[0]:.1f} x {wide[1]:.1f} mm, to {1e3 * box['depth_m']:.1f} mm deep, "
        f"{box['sites'][0]} x {box['sites'][1]} sites, {box['depths']} depths",
        f"error of the tables, {wrong['felt']} held-out states over 0.05 N: force "
        + (_wrong(wrong) if wrong["felt"] else "not measured, a larger --depth would")
        + f"; shape rms {1e3 * wrong['surface_rms_m']:.3f} mm, worst {1e3 * wrong['surface_worst_m']:.2f} mm",
    ]
    if own and own["force_worst"] is not None:
        lines.append(
            f"error of the full model ({own['elements']} elements, refined to {own['elements_refined']}): force "
            + "changes "
            + ", ".join(f"{100 * c:+.1f} % at {1e3 * d:.1f} mm" for c, d in zip(own["force_change"], own["depths_m"]))
        )
    else:
        lines.append("error of the full model's mesh: not measured")
    return lines


def _wrong(wrong: dict) -> str:
    said = f"median {100 * wrong['force_median']:.2f} %, worst {100 * wrong['force_worst']:.2f} %"
    if wrong.get("worst_at_m"):
        x, y, depth = (1e3 * v for v in wrong["worst_at_m"])
        said += f" at ({x:.1f}, {y:.1f}) mm, {depth:.1f} mm deep (vertical force alone: median "
        said += f"{100 * wrong['vertical_median']:.2f} %, worst {100 * wrong['vertical_worst']:.2f} %)"
    return said


def place_of(text: str) -> np.ndarray:
    """`12,8` in mm as metres."""
    try:
        x, y = (float(part) / 1e3 for part in text.split(","))
        if not np.isfinite([x, y]).all():
            raise ValueError
    except ValueError:
        raise InputError(f"--site {text}: wanted is X,Y in mm, e.g. --site 12,8") from None
    return np.array([x, y])


def counts_of(text: str) -> tuple[int, int, int]:
    """`16x16x6` as numbers of elements."""
    try:
        nx, ny, nz = (int(part) for part in text.split("x"))
    except ValueError:
        raise InputError(f"--mesh {text}: wanted is AxBxC, e.g. 16x16x6") from None
    if nx % 2 or ny % 2 or min(nx, ny) < 8 or nz < 2:
        raise InputError(f"--mesh {text}: even numbers of at least 8 in plan, at least 2 in height")
    return nx, ny, nz
