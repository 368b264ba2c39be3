"""What another simulator's probing says of the share: p01 at its true constants, on the mesh of a descent and the last.

Needs the practice files (`TISSUEJAX_SHARED`); none of them is written to.
"""

import json
import os
from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.options import Unknowns
from tissuejax.fitting.setup import problem
from tissuejax.verbs import material

SHARES, FITTED = (0.05, 0.1, 0.3), ("r1", "r2")


def practice() -> Path:
    """Where the practice probings are."""
    root = Path(__file__).resolve().parents[2]
    return Path(os.environ.get("TISSUEJAX_SHARED", root.parent / "shared")) / "practice"


def misfits() -> dict:
    """Mean square of the forces' residuals over the noise, by mesh and share; 1 is noise alone."""
    base = json.loads((practice() / "keys-probing.json").read_text())["p01"]["base"]
    true = {"energy.C10": base["C10"], "energy.C20": base["C20"], "volumetric.K": base["K"]}
    model = material("reduced-polynomial-2", volumetric="quadratic")
    plain = predictor(model, tj.read(practice() / "p01.h5"), list(FITTED))
    found: dict = {}
    for settings in (plain.settings, plain.settings.finer):
        row = found["x".join(map(str, settings.counts))] = {}
        for share in SHARES:
            posed = problem(plain.with_settings(settings.changed(hourglass=share)), unknowns=Unknowns(start=true))
            r = posed.residuals(dict(posed.start))
            row[f"share {share:g}"] = {n: float(np.mean(r[posed.rows[n, "force"]] ** 2)) for n in FITTED}
    return found
