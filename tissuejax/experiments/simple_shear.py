"""Simple shear, also at a fixed stretch along the normal of the sheared plates (compound shear)."""

from typing import ClassVar

from tissuejax.experiments.homogeneous import Homogeneous


class SimpleShear(Homogeneous):
    """F = e_i e_i + gamma e1 e2, reported as the nominal shear stress P12; the third face is free (P33 = 0).

    With the recording's attribute `axial_stretch` = b the plates (normal e2) are first moved apart by b and the
    specimen gets thinner: F = diag(b^-1/2, b, b^-1/2) + gamma e1 e2, gamma being displacement over original height.
    Source: Holzapfel 2000, sec. 6.5; Budday et al. 2017, Acta Biomaterialia 48 (shear and axial modes).
    """

    name: ClassVar[str] = "simple-shear"
    mode: ClassVar[str] = "shear"
    driven: ClassVar[str] = "shear"
    columns: ClassVar[int] = 1
