"""What laws of a matrix with two symmetric families of fibres share: constants and directions."""

from tissuejax.arrays import Either
from tissuejax.parameters import Constants, Parameter

REINFORCED = (
    Parameter("mu", "Pa", 1000.0, lower=0.0, meaning="shear modulus of the matrix"),
    Parameter("k1", "Pa", 1000.0, lower=0.0, meaning="stiffness of the fibres"),
    Parameter("k2", "1", 1.0, lower=0.0, upper=1e3, meaning="stiffening of the fibres"),
)
DIRECTIONS = (
    Parameter("spread", "rad", 0.6, lower=0.0, upper=1.6, scale=1.0, meaning="half the angle between the families"),
    Parameter(
        "angle", "rad", 0.0, lower=-3.2, upper=3.2, scale=1.0, meaning="direction midway, from axis 1 to 2", frozen=True
    ),
)


def directions(p: Constants) -> tuple[Either, Either]:
    """Direction of each family from axis 1 to 2, rad: `angle` plus and minus `spread`."""
    return p["angle"] + p["spread"], p["angle"] - p["spread"]
