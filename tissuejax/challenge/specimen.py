"""What is done to a challenge specimen, and how its free faces answer: plain numpy, one (n, 3, 3) tensor over time.

Axes are (loaded, second, free). The free third face gives the pressure, so the nominal stress of a face is
(tau_ii - tau_33) / F_ii with tau the Kirchhoff stress without pressure, compressible or not; what has to be searched
is only the volume ratio (finite bulk modulus) and, in a uniaxial test of a specimen with fibres, the ratio of its two
lateral stretches.
Source of the kinematics: Holzapfel 2000, section 6.5; Treloar 1975, ch. 5.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.errors import NotConverged

Tensors = Float[np.ndarray, "n 3 3"]


@dataclass(frozen=True)
class Trial:
    """One recording to be made.

    Attributes:
        name: group name in the file.
        kind: "uniaxial", "planar", "equibiaxial", "biaxial" or "simple-shear".
        time: s, (n,).
        drive: stretch (n,), two stretches (n, 2), or amount of shear (n,).
        direction: loaded direction in the sample's frame.
        start: s after the sample's first recording.
        area, height, diameter: of the undeformed specimen, m^2 and m.
    """

    name: str
    kind: str
    time: Float[np.ndarray, " n"]
    drive: Float[np.ndarray, "n ..."]
    direction: Float[np.ndarray, "3"]
    start: float
    area: float
    height: float
    diameter: float

    @property
    def rest(self) -> float:
        """The drive of the undeformed specimen."""
        return 0.0 if self.kind == "simple-shear" else 1.0

    @property
    def strain(self) -> Float[np.ndarray, "n ..."]:
        """Logarithmic stretch, or shear: zero at rest, signed."""
        return self.drive if self.kind == "simple-shear" else np.log(self.drive)


def axes(direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Rows: loaded, second, free axis in the sample's frame; free is nearest to z, or to y when loaded along z."""
    first = direction / np.linalg.norm(direction)
    near = np.array([0.0, 1.0, 0.0]) if abs(first[2]) >= 0.9 else np.array([0.0, 0.0, 1.0])
    free = near - (near @ first) * first
    free /= np.linalg.norm(free)
    return np.array([first, np.cross(free, first), free])


def gradient(kind: str, drive: Float[np.ndarray, "n ..."], ln_J: np.ndarray, skew: np.ndarray) -> Tensors:
    """Deformation gradient over time; `skew` is half of ln(l2/l3) beyond the isotropic answer (uniaxial only)."""
    F = np.zeros((len(drive), 3, 3))
    J = np.exp(ln_J)
    if kind == "simple-shear":
        F[:] = np.eye(3)
        F[:, 0, 1] = drive
        F[:, 2, 2] = J
        return F
    if kind == "biaxial":
        one, two = drive[:, 0], drive[:, 1]
    else:
        one = drive
        two = {"uniaxial": np.sqrt(J / one) * np.exp(skew), "planar": np.ones_like(one), "equibiaxial": one}[kind]
    F[:, 0, 0], F[:, 1, 1], F[:, 2, 2] = one, two, J / (one * two)
    return F


def kirchhoff(F: Tensors, S: Tensors) -> Tensors:
    """F S F^T."""
    return F @ S @ np.swapaxes(F, 1, 2)


def nominal(kind: str, F: Tensors, S: Tensors) -> Float[np.ndarray, "n ..."]:
    """Nominal stress that the free third face leaves, Pa; (n, 2) for biaxial, P12 for simple shear."""
    tau = kirchhoff(F, S)
    if kind == "simple-shear":  # P = tau F^-T; the pressure has no 12 part
        return tau[:, 0, 1]
    free = tau[:, 2, 2]
    first = (tau[:, 0, 0] - free) / F[:, 0, 0]
    if kind == "biaxial":
        return np.stack([first, (tau[:, 1, 1] - free) / F[:, 1, 1]], -1)
    return first


def settle(
    trial: Trial,
    drive: Float[np.ndarray, "n ..."],
    stress: Callable[[Tensors], Tensors],
    bulk: float | None,
    fibres: bool,
    scale: float,
    swollen: Float[np.ndarray, " n"] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """(ln J, skew) that free the lateral faces, by Newton's method at every time at once.

    Args:
        stress: second Piola-Kirchhoff stress without pressure from F.
        bulk: K of K/2 (J - 1)^2, Pa; None is incompressible.
        fibres: whether the lateral faces of a uniaxial specimen can differ.
        scale: a modulus, Pa, to make the residual a number.
        swollen: ln J where it is known already (0 by default), of a specimen without `bulk`.

    Raises:
        NotConverged: no equilibrium of the faces after 60 steps.
    """
    n = len(drive)
    x = np.zeros((n, 2))
    if swollen is not None:
        x[:, 0] = swollen
    search = [bulk is not None, fibres and trial.kind == "uniaxial"]
    if not any(search):
        return x[:, 0], x[:, 1]

    def residual(x: np.ndarray) -> np.ndarray:
        F = gradient(trial.kind, drive, x[:, 0], x[:, 1])
        tau = kirchhoff(F, stress(F))
        J = np.exp(x[:, 0])
        swell = tau[:, 2, 2] / scale + (0.0 if bulk is None else bulk * J * (J - 1) / scale)
        across = (tau[:, 1, 1] - tau[:, 2, 2]) / scale
        known = x[:, 0] - (0.0 if swollen is None else swollen)
        return np.stack([swell if search[0] else known, across if search[1] else x[:, 1]], -1)

    for _ in range(60):
        r = residual(x)
        if np.max(np.abs(r)) < 1e-10:
            return x[:, 0], x[:, 1]
        h = 1e-6
        slopes = np.stack([(residual(x + h * np.eye(2)[k]) - r) / h for k in range(2)], -1)
        x = x - np.clip(np.linalg.solve(slopes, r[..., None])[..., 0], -0.2, 0.2)
    raise NotConverged(
        f"{trial.name}: lateral faces of a challenge specimen don't settle (residual {np.abs(r).max():g})"
    )
