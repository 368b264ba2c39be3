"""Biaxial tension with two independent stretches; the third face is free."""

from typing import ClassVar

from tissuejax.experiments.homogeneous import Homogeneous


class Biaxial(Homogeneous):
    """F = diag(l1, l2, J/(l1 l2)); both in-plane nominal stresses are recorded. Source: Rivlin & Saunders 1951."""

    name: ClassVar[str] = "biaxial"
    mode: ClassVar[str] = "biaxial"
    driven: ClassVar[str] = "stretch"
    columns: ClassVar[int] = 2
