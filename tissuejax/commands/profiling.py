"""`tissuejax profile`: intervals of a fit's parameters by profile likelihood."""

import argparse
import math
from typing import ClassVar

from tissuejax import verbs
from tissuejax.commands.arguments import add_fit, add_model, fit_options
from tissuejax.commands.command import Command, Reply
from tissuejax.commands.outputs import add_out, folder, listed, made
from tissuejax.errors import unknown
from tissuejax.fitting.profile import profile
from tissuejax.fitting.result import described
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read
from tissuejax.report.page import write_figures
from tissuejax.report.profiles import Profiles, write_profiles
from tissuejax.storage import write_json


class ProfileCommand(Command):
    """Fit, then profile."""

    name: ClassVar[str] = "profile"
    order: ClassVar[int] = 31
    summary: ClassVar[str] = "95 % intervals by profile likelihood, beside those of the standard errors"
    teaches: ClassVar[str] = """
Fit, then hold each parameter away from its estimate and fit the others again: the interval in which chi-square rises
by less than 3.84 (more where few residuals tell the noise) holds the truth in 95 % of cases, also where the misfit is
no parabola; where it does not close, the data do not bound the parameter on that side.

  tissuejax profile liver.h5 --energy demiray
  tissuejax profile rubber.toml --energy ogden-2 --ogden-form mu/alpha --path energy.alpha1 --path energy.alpha2
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FILE, model, fit options, --path, --points, --out."""
        parser.add_argument(
            "file", metavar="FILE", help="recording file or side file; FILE#NAME for one sample of many"
        )
        add_model(parser)
        add_fit(parser)
        parser.add_argument(
            "--path", action="append", metavar="PATH", help="profile this one (repeat; default: all free)"
        )
        parser.add_argument("--points", type=int, default=6, metavar="N", help="on either side (default 6)")
        add_out(parser, "out/SAMPLE-profile-ENERGY")

    def run(self, given: argparse.Namespace) -> Reply:
        """Fit, profile, draw."""
        sample = read(given.file)
        model = verbs.material(
            given.energy, ogden_form=given.ogden_form, volumetric=given.volumetric, effects=given.effect
        ).across(tuple(sample.recordings))
        named = [described(model)["name"], *(e.name for e in model.effects)]
        out = folder(given.out, "profile", sample.name, named, given.force)
        found = verbs.fit(sample, model, progress=for_terminal(), **fit_options(given, model.parameters))
        paths = tuple(given.path or found.free)
        for path in paths:
            if path not in found.free:
                raise unknown("free parameter", path, found.free)
        profiles = []
        with for_terminal().stage("profiling", len(paths)) as stage:
            for path in paths:
                profiles.append(profile(found, path, points=given.points))
                stage.advance(note=path)
        rows = {
            p.path: {
                "value": found.values[p.path],
                "unit": model.parameters[p.path].unit,
                "interval": list(p.interval),
                "normal": list(found.intervals[p.path]),
                "held": p.values.tolist(),
                "rise": p.rise.tolist(),
            }
            for p in profiles
        }
        mine = made("profile", sample.name, named)
        files = {
            "result": write_json(out / "profiles.json", {"made": mine, "profiles": rows, "warnings": found.warnings})
        }
        drawn = Profiles(found, tuple(profiles))
        files |= write_figures(drawn, out) | {"curves": write_profiles(drawn, out / "profiles.csv")}
        lines = [f"{'parameter':<36}{'estimate':>12}  {'95 % by profile':<28}{'by standard error'}"]
        for path, t in rows.items():
            ends, normal = (" to ".join(_end(e) for e in t[key]) for key in ("interval", "normal"))
            lines.append(
                f"{path:<36}{t['value']:>12.5g}  {ends:<28}{normal}{'' if t['unit'] == '1' else ' ' + t['unit']}"
            )
        lines += [f"  ! {w}" for w in found.warnings] + ["", *listed(files)]
        record = {"profiles": rows, "warnings": found.warnings, "files": {n: str(p) for n, p in files.items()}}
        return Reply(record, "\n".join(lines), 0 if found.converged else 3)


def _end(x: float) -> str:
    return f"{x:.5g}" if math.isfinite(x) else "open"
