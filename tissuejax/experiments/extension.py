"""Tests in which one stretch is driven and the second follows from it by a power law.

Uniaxial, planar and equibiaxial tests differ in two exponents only, l2 = l1^second J^swell, so that one compiled
prediction serves them all: the exponents are arguments, not code.
"""

from typing import ClassVar

from tissuejax.experiments.homogeneous import Homogeneous


class Extension(Homogeneous):
    """A test with one driven stretch, one recorded stress, and l2 = l1^second J^swell; the third face is free."""

    mode: ClassVar[str] = "extension"
    driven: ClassVar[str] = "stretch"
    columns: ClassVar[int] = 1
    second: ClassVar[float]
    swell: ClassVar[float]
