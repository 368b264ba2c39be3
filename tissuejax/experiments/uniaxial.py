"""Uniaxial tension and compression: one stretch prescribed, the two lateral faces free."""

from typing import ClassVar

from tissuejax.experiments.extension import Extension


class Uniaxial(Extension):
    """F = diag(l, (J/l)^1/2, (J/l)^1/2), stretch below one is compression. Source: Holzapfel 2000, sec. 6.5."""

    name: ClassVar[str] = "uniaxial"
    second: ClassVar[float] = -0.5
    swell: ClassVar[float] = 0.5
