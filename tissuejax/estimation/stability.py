"""Material stability (Drucker) over the stretches that were recorded: looked at after every fit, kept during one on
request.

Which stretches: each path (uniaxial, planar, equibiaxial) as far as its principal stretches stay within those that
occur in the recordings, so that nobody is warned of states the data never came near.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.energies.energy import Energy
from tissuejax.energies.stability import (
    PATHS,
    PathStability,
    Stability,
    least_eigenvalue,
    log_strain_tangent,
    stability,
)
from tissuejax.experiments.predictor import Predictor
from tissuejax.parameters import under
from tissuejax.recordings.recording import Recording

UNKNOWN = (0.7, 1.4)  # principal stretches where a recording doesn't give them (a probing)
POINTS = 40  # stretches a path at which the constraint is kept
MARGIN = 1e-3  # least stiffness kept, as a share of the mean stiffness


def principal_range(recordings: Mapping[str, Recording]) -> tuple[float, float]:
    """Smallest and largest principal stretch in the recordings, taken as incompressible."""
    found = []
    for recording in recordings.values():
        stretch, shear = recording.inputs.get("stretch"), recording.inputs.get("shear")
        if stretch is not None:
            one = np.asarray(stretch, float).reshape(len(stretch), -1)
            second = {"uniaxial": -0.5, "planar": 0.0, "equibiaxial": 1.0}.get(recording.experiment, 0.0)
            two = one[:, 1] if one.shape[1] > 1 else one[:, 0] ** second
            found += [one[:, 0], two, 1 / (one[:, 0] * two)]
        elif shear is not None:
            half = np.abs(np.asarray(shear, float)) / 2
            largest = half + np.sqrt(1 + half**2)
            found += [largest, 1 / largest]
        else:
            found.append(np.array(UNKNOWN))
    every = np.concatenate(found)
    return float(min(every.min(), 0.999)), float(max(every.max(), 1.001))


def ranges(recordings: Mapping[str, Recording]) -> dict[str, tuple[float, float]]:
    """For each path the range of its stretch in which all principal stretches stay within the recorded ones."""
    low, high = principal_range(recordings)
    return {
        "uniaxial": (max(low, high**-2), min(high, low**-2)),
        "planar": (max(low, 1 / high), min(high, 1 / low)),
        "equibiaxial": (max(low, high**-0.5), min(high, low**-0.5)),
    }


def recorded_stability(predictor: Predictor, values: Mapping[str, float]) -> Stability:
    """Stability of the energy at `values` over the recorded stretches."""
    constants: dict[str, Any] = {name: float(v) for name, v in under("energy", values).items()}
    within = ranges({name: predictor.sample.recordings[name] for name in predictor.names})
    paths: dict[str, PathStability] = {}
    for path in PATHS:
        paths |= stability(predictor.model.energy, constants, within[path], (path,)).paths
    return Stability(paths)


def sentence(found: Stability) -> str:
    """What is unstable, path by path; empty if nothing is."""
    bad = []
    for path in found.paths.values():
        if path.unstable_above is not None:
            bad.append(f"{path.path} from stretch {path.unstable_above:.3g} up")
        if path.unstable_below is not None:
            bad.append(f"{path.path} from stretch {path.unstable_below:.3g} down")
    if not bad:
        return ""
    return (
        f"The fitted energy is unstable (Drucker) inside the recorded range: {'; '.join(bad)}. Don't simulate beyond."
    )


def penalty_rows(
    predictor: Predictor, values: Mapping[str, float], free: tuple[str, ...], strength: float
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m p"]]:
    """Residual rows, zero where the energy is stable with a small margin, and their Jacobian to the free parameters."""
    energy = predictor.model.energy
    names = tuple(p.name for p in energy.parameters)
    theta = np.array([float(values[f"energy.{name}"]) for name in names])
    within = ranges({name: predictor.sample.recordings[name] for name in predictor.names})
    rows, slopes = [], []
    for path, (low, high) in within.items():
        r, slope = _rows(energy, path, names, theta, np.geomspace(low, high, POINTS))
        rows.append(np.asarray(r))
        slopes.append(np.asarray(slope))
    slopes = np.concatenate(slopes)
    jacobian = np.zeros((len(slopes), len(free)))
    for column, path in enumerate(free):
        if path.startswith("energy."):
            jacobian[:, column] = slopes[:, names.index(path.removeprefix("energy."))]
    return strength * np.concatenate(rows), strength * jacobian


@partial(jax.jit, static_argnums=(0, 1, 2))
def _rows(energy: Energy, path: str, names: tuple[str, ...], theta, stretch):
    def rows(theta):
        p = dict(zip(names, theta, strict=True))
        size = jax.lax.stop_gradient(jnp.mean(jnp.abs(log_strain_tangent(energy, p, path, stretch))))
        return jnp.maximum(MARGIN - least_eigenvalue(energy, p, path, stretch) / size, 0.0)

    return rows(theta), jax.jacfwd(rows)(theta)
