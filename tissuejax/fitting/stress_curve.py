"""The source's manual identification made automatic: scale the compression curve by the ratio of forces, and repeat.

The tissue's nominal stress T in uniaxial compression is multiplied, strain by strain, by measured over simulated force,
T_a = T F_e / F_s, where a depth d of the probe stands for the compression stretch 1 - d / h of a column as high as the
tissue is thick; the energy is fitted to T_a, checked for stability, and the probing simulated again (Lister 2012,
2.2.5). Kept for comparison: it needs no derivative, uses one number a depth and no marker.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError, UnstableSimulation
from tissuejax.estimation.covariance import Uncertainty
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.stability import recorded_stability
from tissuejax.experiments.predictor import predictor
from tissuejax.experiments.probing_predictor import ProbingPredictor
from tissuejax.fitting.least_squares import descend
from tissuejax.fitting.options import Unknowns
from tissuejax.fitting.result import Fit, Iterate
from tissuejax.fitting.scores import scores
from tissuejax.fitting.setup import problem
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample

LEAST_CHANGE = 0.02  # share of the greatest force below which a ratio of forces is noise
CAP = 8.0  # largest factor on the stress in one iteration
POINTS = 25
ITERATIONS = 4  # as many as the source made
METHOD = "stress-curve"


@dataclass(frozen=True)
class Turn:
    """One iteration: values simulated, force and marker error, stability of the energy fitted next."""

    values: dict[str, float]
    force_rmse: float
    marker_rmse: float | None
    stable: bool


def fit_stress_curve(posed: Problem, *, holdout: tuple[str, ...] = (), iterations: int = ITERATIONS) -> Fit:
    """The iteration as a fit of one probing: values, errors before and after, no standard errors.

    Raises:
        InputError: other experiments, or more than one recording.
    """
    probing, begun = posed.predictor, time.perf_counter()
    if not isinstance(probing, ProbingPredictor) or len(probing.names) > 1:
        raise InputError(
            f"the stress-curve iteration takes one probing, got {', '.join(probing.names)}: name one with --only, or "
            "leave --method out"
        )
    (name,) = probing.names
    measured = probing.sample.recordings
    values, turns = stress_curve(probing, name, posed.start, iterations)
    fitted, held = probing.predict(values), dict(probing.of(holdout).predict(values)) if holdout else {}
    std = dict(posed.noise.std)
    for other in holdout:
        for channel, series in measured[other].channels.items():
            std[f"{other}/{channel}"] = series.noise_std or std.get(f"{name}/{channel}", 1.0)
    marks = scores(measured, fitted, std)
    p = len(posed.free)
    unknown = np.full((p, p), np.nan)
    runs = [t.force_rmse for t in turns]
    force, markers = errors(measured[name], fitted[name])
    sites = {"force": {"before": runs[0], "after": force}}
    if markers is not None:
        sites["markers"] = {"before": turns[0].marker_rmse, "after": markers}
    said = "The stress-curve iteration gives no standard errors, and nothing tells whether another turn would help."
    return Fit(
        problem=posed,
        status=Ending.CONVERGED
        if abs(runs[-1] - runs[-2]) < 0.05 * runs[-2]
        else f"stopped after {iterations} iterations",
        values=values,
        uncertainty=Uncertainty(np.full(p, np.inf), unknown, unknown, np.inf, (said,)),
        at_bound={},
        chi2=sum(s.chi2_per_sample * s.n for s in marks.values()),
        channels=marks,
        holdout=scores(measured, held, std),
        predictions=dict(fitted) | held,
        trace=[Iterate(i, (t.force_rmse / std[f"{name}/force"]) ** 2, t.values) for i, t in enumerate(turns, 1)],
        stability=recorded_stability(probing, values),
        starts=[],
        n_evaluations=len(turns) + 1,
        seconds=time.perf_counter() - begun,
        warnings=[said],
        method=METHOD,
        sites={name: sites},
    )


def stress_curve(
    probing: ProbingPredictor, name: str, start: Mapping[str, float], iterations: int = ITERATIONS
) -> tuple[dict[str, float], list[Turn]]:
    """Values after some iterations on one recording, and how it went; the first turn is the start.

    Args:
        probing: predicts recording `name`.
        name: the recording.
        start: all values of the model; those of the energy are changed.
        iterations: simulations after the first.
    """
    values = dict(start)
    turns, best = [], dict(start)
    for turn in range(iterations + 1):
        try:
            predicted = probing.predict(values)[name]
        except UnstableSimulation:
            turns.append(Turn(values, float("inf"), None, False))
            values = {k: 0.5 * (values[k] + best[k]) for k in values}  # half-way back to the last that ran
            continue
        best = values
        force, markers = errors(probing.sample.recordings[name], predicted)
        stretch, factor = ratio(probing, name, predicted)
        after, stable = refit(probing.model, values, stretch, factor) if turn < iterations else (values, True)
        turns.append(Turn(values, force, markers, stable))
        values = after
    return best, turns


def errors(measured: Recording, predicted: Recording) -> tuple[float, float | None]:
    """Force RMSE (eq. 2.2), N, and marker RMSE (eq. 2.3), m: root mean square length of the error vectors."""

    def rms(channel):
        d = np.asarray(predicted.channels[channel].values, float) - np.asarray(measured.channels[channel].values, float)
        return float(np.sqrt(np.nanmean(np.sum(d**2, axis=-1))))

    return rms("force"), rms("markers") if "markers" in measured.channels else None


def ratio(probing: ProbingPredictor, name: str, predicted: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Compression stretch and measured over simulated force along the way down, stretch falling from 1."""
    measured, setup = probing.sample.recordings[name], probing.setups[name]
    channel = measured.channels["force"]
    time = np.asarray(channel.time, float)
    lowest = np.interp(time, np.asarray(setup.scene.probe.time), np.asarray(setup.scene.probe.position)[:, 2])
    touch, bottom = float(setup.test.first_touch), int(lowest.argmin())
    depth = np.interp(touch, time, lowest) - lowest
    real, simulated = (np.asarray(c.values, float)[:, 2] for c in (channel, predicted.channels["force"]))
    going = np.arange(len(time)) <= bottom
    seen = going & (depth > 0) & (np.minimum(real, simulated) > LEAST_CHANGE * np.minimum(real.max(), simulated.max()))
    grid = np.linspace(depth[seen].min(), depth[seen].max(), POINTS)
    order = np.argsort(depth[seen])
    smooth = [np.polyval(np.polyfit(depth[seen][order], f[seen][order], 4), grid) for f in (real, simulated)]
    factor = np.clip(smooth[0] / np.maximum(smooth[1], 1e-9), 1 / CAP, CAP)
    return 1 - grid / float(setup.test.height), factor


def refit(
    model: Model, values: Mapping[str, float], stretch: Float[np.ndarray, " n"], factor: Float[np.ndarray, " n"]
) -> tuple[dict[str, float], bool]:
    """The energy fitted to its own compression curve times `factor`, and whether it is stable there."""
    order = np.argsort(-stretch)
    stretch, factor = stretch[order], factor[order]
    stretch = np.concatenate([[1.0], stretch])
    alone = Model(model.energy)
    time = np.arange(float(len(stretch)))
    blank = Channel(time, np.zeros(len(time)), "Pa", 1.0)
    test = Recording("curve", "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": blank})
    energy = {k: v for k, v in values.items() if k.startswith("energy.")}
    curve = predictor(alone, Sample("curve", {"curve": test})).predict(energy)["curve"]
    target = np.asarray(curve.channels["nominal_stress"].values, float) * np.concatenate([[factor[0]], factor])
    noise = 0.01 * float(np.abs(target).max())
    wanted = Recording("curve", "uniaxial", test.inputs, {"nominal_stress": Channel(time, target, "Pa", noise)})
    posed = problem(predictor(alone, Sample("curve", {"curve": wanted})), unknowns=Unknowns(start=energy, stable=True))
    found = posed.values(descend(posed).y)
    return dict(values) | found, recorded_stability(posed.predictor, found).stable
