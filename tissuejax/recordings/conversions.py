"""From what a lab's machine writes to stretch and nominal stress, for incompressible specimens.

Plain numpy, SI in and out. Processing that belongs to a rig (thawing, filters, contact) is in `rig.py`.
"""

import numpy as np
from jaxtyping import Float

Series = Float[np.ndarray, "n ..."]


def stretch_from_displacement(displacement: Series, height: float) -> Series:
    """1 + u/h: displacement in m (extension positive) over the undeformed height in m."""
    return 1.0 + displacement / height


def path_length(motion: Float[np.ndarray, "n ..."]) -> Float[np.ndarray, " n"]:
    """Length of the way through deformation: the abscissa of a smooth curve where no time was recorded."""
    steps = np.abs(np.diff(motion.reshape(len(motion), -1), axis=0)).sum(axis=1)
    return np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-12))])


def stretch_from_strain(strain: Series) -> Series:
    """1 + e for engineering strain."""
    return 1.0 + strain


def stretch_from_true_strain(strain: Series) -> Series:
    """exp(e) for true (logarithmic) strain."""
    return np.exp(strain)


def true_strain(stretch: Series) -> Series:
    """ln(stretch)."""
    return np.log(stretch)


def nominal_from_force(force: Series, area: float) -> Series:
    """Nominal stress, Pa: force in N (tension positive) over the undeformed area in m^2."""
    return force / area


def nominal_from_true(stress: Series, stretch: Series) -> Series:
    """Nominal stress P_i = sigma_i / stretch_i of an incompressible specimen stretched along its axes.

    From P = J sigma F^-T with J = 1; holds for each axis of uniaxial, planar, equibiaxial and biaxial tests.
    """
    return stress / stretch


def true_from_nominal(stress: Series, stretch: Series) -> Series:
    """Cauchy stress sigma_i = P_i stretch_i, the inverse of `nominal_from_true`."""
    return stress * stretch


def disc_area(diameter: float) -> float:
    """pi d^2 / 4, m^2."""
    return np.pi * diameter**2 / 4


def noise_estimate(abscissa: Float[np.ndarray, " n"], values: Series) -> float:
    """Standard deviation of the noise on a smooth curve, from how far each sample lies off the line between its
    neighbours.

    With weights a + b = 1 of the neighbours, each deviation has variance s^2 (a^2 + b^2 + 1); the mean over all
    estimates s. Curvature between neighbours adds to it, so sparse data give an upper estimate.

    Source: Gasser, Sroka, Jennen-Steinmetz 1986, Biometrika 73:625, eq. 1-3.
    """
    if len(abscissa) < 3:
        return 0.0
    before, here, after = abscissa[:-2], abscissa[1:-1], abscissa[2:]
    a = ((after - here) / (after - before)).reshape(-1, *[1] * (values.ndim - 1))
    deviation = a * values[:-2] + (1 - a) * values[2:] - values[1:-1]
    return float(np.sqrt(np.mean(deviation**2 / (a**2 + (1 - a) ** 2 + 1))))


def noise_of(abscissa: Float[np.ndarray, " n"], values: Series) -> float | None:
    """`noise_estimate`, at least a millionth of the peak, because exact data would weigh infinitely; None where all
    values are zero."""
    return max(noise_estimate(abscissa, values), 1e-6 * float(np.abs(values).max())) or None
