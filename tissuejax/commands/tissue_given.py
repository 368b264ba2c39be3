"""Which tissue is meant, for `precompute` and `play`: a fit's folder, or a body and a model by name."""

import argparse
import json
import re
from pathlib import Path

import numpy as np

from tissuejax import verbs
from tissuejax.commands.arguments import add_model, values
from tissuejax.errors import InputError
from tissuejax.estimation.ending import Ending
from tissuejax.experiments.homogeneous import local
from tissuejax.experiments.probing_setup import site
from tissuejax.mesh.cloud import lobe_of_cloud
from tissuejax.mesh.columns import Lobe, box, lobe_of_mesh, top_of
from tissuejax.model import Model
from tissuejax.recordings.files import read
from tissuejax.recordings.recording import Sample
from tissuejax.surrogate.ramp import Matter


def add_tissue(parser: argparse.ArgumentParser) -> None:
    """SOURCE, the model and the ball."""
    parser.add_argument(
        "source", nargs="?", metavar="SOURCE", help="folder of a fit, or a recording file with the body"
    )
    parser.add_argument("--sample", metavar="FILE", help="recording file with the body, where SOURCE is a fit's folder")
    parser.add_argument("--recording", metavar="NAME", help="take the probe (and what is its own) from this recording")
    parser.add_argument("--slab", metavar="AxBxC", help="a slab of this size in mm instead of a body, e.g. 60x60x20")
    parser.add_argument("--radius", metavar="MM", type=float, help="of the ball (default: the recording's)")
    parser.add_argument("--anyway", action="store_true", help="also from a fit that did not converge")
    parser.add_argument("--value", action="append", default=[], metavar="PATH=VALUE", help="e.g. energy.C10=645")
    add_model(parser, required=False)


class Tissue:
    """What was given: `matter`, the sample (or None), the chosen recording's name (or None) and the result's hash."""

    def __init__(self, matter: Matter, sample: Sample | None, recording: str | None, site: np.ndarray):
        self.matter, self.sample, self.recording, self.site = matter, sample, recording, site


def tissue(given: argparse.Namespace) -> Tissue:
    """The tissue meant by the arguments.

    Raises:
        InputError: nothing to go by, a fit that did not converge, no radius.
    """
    model, found = _model(given)
    file = given.sample or (given.source if given.source and not _is_fit(given.source) else None)
    sample = None if file is None else read(file)
    name, lobe, density, radius = None, None, 1060.0, given.radius
    if sample is not None:
        probings = {n: r for n, r in sample.recordings.items() if r.experiment == "probing"}
        if given.recording is not None and given.recording not in probings:
            raise InputError(f"--recording {given.recording}: {file} has {', '.join(probings) or 'no probing'}")
        name = given.recording or next(iter(probings), None)
        if sample.geometry is None:
            raise InputError(f"{file}: it has no body (/geometry); name one with --sample, or give a --slab")
        lobe, density = lobe_of(sample), sample.density or density
        if name is not None and "probe/edge" in probings[name].attributes:
            raise InputError(
                f"{file}: {name} was probed with a flat punch; surrogates are of balls: name --radius alone"
            )
        if radius is None and name is not None:
            radius = 1e3 * float(probings[name].attributes.get("probe/radius", np.nan))
    if given.slab is not None:
        lobe = lobe_of_mesh(box(size(given.slab), (4, 4, 2)))
    if lobe is None:
        raise InputError("which body? name the recording file (--sample FILE) or a slab (--slab 60x60x20, in mm)")
    if radius is None or not radius > 0:
        raise InputError("the radius of the ball isn't known: give --radius in mm, e.g. --radius 4.75")
    names = () if sample is None else tuple(sample.recordings)
    whole = dict(model.across(names).defaults) | found
    whole |= values(given.value, model.across(names).parameters, "--value")
    own = local(model.across(names), whole, name) if names else whole
    where = np.array([float(f(0.5, 0.5)[0, 0]) for f in (lobe.x, lobe.y)])
    if name is not None and sample is not None:
        where = site(np.asarray(sample.recordings[name].inputs["probe/position"], float))
    return Tissue(Matter(model.across(()), own, lobe, radius / 1e3, density), sample, name, where)


def lobe_of(sample: Sample) -> Lobe:
    """The organ as a map that columns are cut from."""
    if sample.geometry.cell_type == "hexahedron":
        return lobe_of_mesh(sample.geometry)
    return lobe_of_cloud(top_of(sample.geometry))


def size(text: str) -> tuple[float, float, float]:
    """`60x60x20` in mm as metres."""
    parts = re.split("[x×,]", text)
    try:
        a, b, c = (float(p) / 1e3 for p in parts)
    except ValueError:
        raise InputError(f"{text!r}: wanted are three lengths in mm, e.g. 60x60x20") from None
    if min(a, b, c) <= 0:
        raise InputError(f"{text!r}: lengths are positive")
    return a, b, c


def _is_fit(source: str) -> bool:
    path = Path(source)
    return path.is_dir() or path.name == "result.json"


def _model(given):
    if given.source is not None and not Path(given.source).exists():
        raise InputError(f"{given.source}: no such file or folder: wanted is a fit's, or a recording with the body")
    if given.source is None or not _is_fit(given.source):
        if given.energy is None:
            raise InputError("which model? name a fit's folder, or --energy with --value PATH=VALUE for each parameter")
        model = verbs.material(
            given.energy, ogden_form=given.ogden_form, volumetric=given.volumetric or "quadratic", effects=given.effect
        )
        return model, {}
    path = Path(given.source)
    path = path / "result.json" if path.is_dir() else path
    try:
        record = json.loads(path.read_text())
        energy = record["energy"]
        model = verbs.material(
            energy["name"], ogden_form=energy["forms"].get("ogden"), volumetric=energy["volumetric"] or "quadratic",
            effects=record["effects"],
        )  # fmt: skip
        found = {p: float(v["value"]) for p, v in record["parameters"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as fault:
        raise InputError(f"{path}: not the result of `tissuejax fit` ({fault})") from fault
    if record["status"] != Ending.CONVERGED and not given.anyway:
        raise InputError(f"{path}: the fit did not converge ({record['status']}); fit on, or say --anyway")
    return model, found


def model_of_record(record: dict) -> tuple[Model, dict[str, float]]:
    """The model and its values from what a surrogate's file says."""
    model = verbs.material(
        record["energy"], ogden_form=record["forms"].get("ogden"), volumetric=record["volumetric"] or "quadratic",
        effects=record["effects"],
    )  # fmt: skip
    return model, dict(record["values"])
