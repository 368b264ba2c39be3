"""The error by marker at the three synthetic sites of fits/in-vivo-liver, as the source states it (2.2.5, 2.2.6).

Ex vivo law, each turn of the stress curve, and the fit by gradients that the study keeps; over the way down in contact.
"""

import json
from dataclasses import replace

import numpy as np

from tissuejax.cache import source
from tissuejax.energies.catalogue import volumetric
from tissuejax.energies.published import published
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.stress_curve import stress_curve
from tissuejax.model import Model
from tissuejax.recordings.recording import Recording

TOUCH = 0.3 + 1e-3 / 1.25e-3  # s, of the study's rig: the probe comes down by 1 mm before


class Quiet:
    """Sensors without noise."""

    def normal(self, mean: float, std: float, shape: tuple[int, ...]) -> np.ndarray:
        """As of a generator."""
        return np.full(shape, mean)


def site(study: dict, name: str) -> dict:
    """Errors of each law that could be simulated, beside the truth without noise and beside the recording."""
    quiet = study["measured"](study["lobe"](), name, Quiet())
    was, rng = quiet.recordings[name], np.random.default_rng([2012, list(study["SITES"]).index(name)])
    sample = replace(quiet, recordings={name: study["noisy"](was, was, rng)})
    entry = published(study["START"])
    start = {f"energy.{k}": float(v) for k, v in entry.constants.items()} | {"volumetric.K": study["K"]}
    p = predictor(Model(entry.energy, volumetric("quadratic")), sample, settings=study["FIT"])
    _, turns = stress_curve(p, name, start)
    kept = json.loads((source.ROOT.parent / "fits" / "in-vivo-liver" / "result.json").read_text())[name]
    laws = {f"turn {i}": turn.values for i, turn in enumerate(turns) if np.isfinite(turn.force_rmse)}
    down = (TOUCH, 0.3 + (study["DEPTH"] + 1e-3) / study["SPEED"])
    found = {}
    for law, values in (laws | {"gradients": kept["gradients"]["values"]}).items():
        told = p.predict(values)[name]
        rest = np.asarray(told.channels["markers"].values)[0]  # estimated from noisy markers
        off = rest - quiet.recordings[name].channels["markers"].values[0]
        found[law] = errors(quiet.recordings[name], told, down, off)
        found[law]["as recorded"] = errors(sample.recordings[name], told, down)
    return {"turns": len(turns) - 1, "laws": found, "displacement_mm": displacement(quiet.recordings[name], down)}


def errors(measured: Recording, told: Recording, span: tuple[float, float], shift=0.0) -> dict:
    """RMSE of the force, N, of each marker (eq. 2.2) and their mean (eq. 2.3), mm, as lengths of vectors.

    `shift`: of the prediction's resting markers, m: taken off, displacements are compared.
    """

    def rms(channel: str, off=0.0) -> np.ndarray:
        series = measured.channels[channel]
        within = (series.time >= span[0]) & (series.time <= span[1])
        apart = np.asarray(told.channels[channel].values)[within] - off - np.asarray(series.values)[within]
        return np.sqrt((apart**2).sum(-1).mean(0))

    marker = 1e3 * rms("markers", shift)
    return {"force_N": float(rms("force")), "marker_mm": marker.tolist(), "mean_mm": float(marker.mean())}


def displacement(measured: Recording, span: tuple[float, float]) -> float:
    """Mean displacement of all markers on the way down, mm."""
    series = measured.channels["markers"]
    within = (series.time >= span[0]) & (series.time <= span[1])
    moved = np.asarray(series.values)[within] - np.asarray(series.values)[0]
    return 1e3 * float(np.linalg.norm(moved, axis=-1).mean())
