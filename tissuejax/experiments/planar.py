"""Planar tension, also called pure shear or constrained tension: the second stretch is held at one."""

from typing import ClassVar

from tissuejax.experiments.extension import Extension


class Planar(Extension):
    """F = diag(l, 1, J/l). Source: Treloar 1944, Trans. Faraday Soc. 40; Holzapfel 2000, sec. 6.5."""

    name: ClassVar[str] = "planar"
    second: ClassVar[float] = 0.0
    swell: ClassVar[float] = 0.0
