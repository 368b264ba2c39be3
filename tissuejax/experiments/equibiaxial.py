"""Equibiaxial tension: the same stretch in both in-plane directions; the stress is that of one of them."""

from typing import ClassVar

from tissuejax.experiments.extension import Extension


class Equibiaxial(Extension):
    """F = diag(l, l, J/l^2). Source: Treloar 1944, Trans. Faraday Soc. 40; Holzapfel 2000, sec. 6.5."""

    name: ClassVar[str] = "equibiaxial"
    second: ClassVar[float] = 1.0
    swell: ClassVar[float] = 0.0
