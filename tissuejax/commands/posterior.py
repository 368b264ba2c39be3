"""`tissuejax posterior`: draws of the parameters of a material test, by Laplace or NUTS, and the evidence."""

import argparse
from typing import ClassVar

import numpy as np

from tissuejax import verbs
from tissuejax.commands.arguments import add_fit, add_model, fit_options, positive
from tissuejax.commands.command import Command, Reply
from tissuejax.commands.outputs import add_out, folder, listed, made
from tissuejax.errors import InputError, unknown
from tissuejax.experiments.catalogue import experiment
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.result import described
from tissuejax.fitting.setup import problem, split
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read
from tissuejax.report.page import write_figures
from tissuejax.storage import replacing, write_json

SAMPLERS = ("laplace", "nuts")


class PosteriorCommand(Command):
    """Fit, then draw."""

    name: ClassVar[str] = "posterior"
    order: ClassVar[int] = 32
    summary: ClassVar[str] = "draws of a material test's parameters (Laplace with checked weights, or NUTS)"
    teaches: ClassVar[str] = """
Fit a material test, then draw from the posterior of its parameters: a flat prior between the bounds, or the normal one
of --prior. laplace takes a second and says by k-hat whether it may be believed (below 0.7, or all weights alike); nuts
takes longer and needs no such luck. --evidence adds ln Z (proper priors for all parameters, at most ten of them).
Written: posterior.json, posterior.nc (arviz InferenceData, for arviz.plot_pair and the like), posterior.png (SVG and
PDF in print/), parameters.tex.

  tissuejax posterior tension.h5 --energy demiray
  tissuejax posterior tension.h5 --energy demiray --sampler nuts --draws 1000
  tissuejax posterior tension.h5 --energy demiray --bounds "energy.mu=0:20 kPa" --bounds "energy.b=0:50" --evidence

Needs the extra `bayes`: pip install 'tissuejax[bayes]'.
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FILE, model, fit options, --sampler, --draws, --chains, --evidence, --out."""
        parser.add_argument("file", metavar="FILE", help="recording file or side file; FILE#NAME for one of many")
        add_model(parser)
        add_fit(parser)
        parser.add_argument("--sampler", default="laplace", metavar="NAME", help="laplace (default) or nuts")
        parser.add_argument("--draws", type=int, default=1000, metavar="N", help="a chain (default 1000)")
        parser.add_argument("--chains", type=int, default=4, metavar="N", help="of nuts (default 4)")
        parser.add_argument("--evidence", action="store_true", help="ln Z by tempered sampling")
        add_out(parser, "out/SAMPLE-posterior-ENERGY")

    def run(self, given: argparse.Namespace) -> Reply:
        """Fit, draw, write."""
        from tissuejax.fitting.evidence import evidence, refuse_improper
        from tissuejax.fitting.posterior import laplace, nuts, target_of
        from tissuejax.report.posterior_pairs import Drawn, write_latex

        if given.sampler not in SAMPLERS:
            raise unknown("sampler", given.sampler, SAMPLERS)
        sample = read(given.file)
        model = verbs.material(
            given.energy, ogden_form=given.ogden_form, volumetric=given.volumetric, effects=given.effect
        ).across(tuple(sample.recordings))
        named = [described(model)["name"], *(e.name for e in model.effects)]
        out = folder(given.out, "posterior", sample.name, named, given.force)
        options = fit_options(given, model.parameters)
        fitted, _ = split(sample, tuple(given.only), tuple(given.holdout))
        for name in fitted:
            if experiment(sample.recordings[name].experiment).kind != "homogeneous":
                raise InputError(
                    f"recording {name}: posteriors are for material tests; a probing has `profile` and standard errors"
                )
        if given.evidence:
            refuse_improper(problem(predictor(model, sample, fitted), options["unknowns"], options["objective"]))
        found = verbs.fit(sample, model, progress=for_terminal(), **options)
        target, mode = target_of(found), np.array([found.values[p] for p in found.free])
        draws = positive(given.draws, "--draws")
        if given.sampler == "laplace":
            draws_made = laplace(target, mode, draws, given.seed)
        else:
            draws_made = nuts(target, mode, draws, positive(given.chains, "--chains"), seed=given.seed)
        record = {"made": made("posterior", sample.name, named)} | draws_made.record()
        if given.evidence:
            z = evidence(target, seed=given.seed)
            record["evidence"] = {"log_evidence": z.log_evidence, "std": z.std, "rungs": z.rungs}
        record["warnings"] = record["warnings"] + found.warnings
        files = {"result": write_json(out / "posterior.json", record)}
        with replacing(out / "posterior.nc") as temporary:
            draws_made.arviz().to_netcdf(str(temporary))
        files["arviz"] = out / "posterior.nc"
        drawn = Drawn(found, draws_made)
        files |= write_figures(drawn, out) | {"table": write_latex(drawn, out / "parameters.tex")}
        units = {p: model.parameters[p].unit for p in found.free}
        lines = [f"{'parameter':<36}{'mean':>12}{'std':>12}  95 %"]
        for path, row in record["parameters"].items():
            low, high = row["95 %"]
            unit = "" if units[path] == "1" else f" {units[path]}"
            lines.append(f"{path:<36}{row['mean']:>12.5g}{row['std']:>12.3g}  {low:.5g} to {high:.5g}{unit}")
        lines.append(", ".join(f"{k} {v:.3g}" for k, v in record["checks"].items()))
        if given.evidence:
            lines.append(f"ln evidence {z.log_evidence:.2f} ± {z.std:.2f}")
        lines += [f"  ! {w}" for w in record["warnings"]] + ["", *listed(files)]
        return Reply(record | {"files": {n: str(p) for n, p in files.items()}}, "\n".join(lines))
