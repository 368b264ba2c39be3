"""Material tests in closed form, and cuts whose steady force is."""

from typing import ClassVar

from tissuejax.fitting.kinds.fitted import Quick


class MaterialTests(Quick):
    """See `Fitted`."""

    name: ClassVar[str] = "homogeneous"


class Cuts(Quick):
    """See `Fitted`."""

    name: ClassVar[str] = "cutting"
