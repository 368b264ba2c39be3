"""How a probing is simulated: mesh, speed, contact and precision, as one frozen record."""

from dataclasses import dataclass, replace

from tissuejax.errors import InputError, unknown

MESHES = ("graded", "file")
REFINED = 1.35
SWIFT = 20.0  # compression: in p01 the derivatives are those at 10 to one per cent, and the misfit too


@dataclass(frozen=True)
class ProbingSettings:
    """Numerical choices. The defaults are the cheap accurate ones; `coarse`, `fine` and `varied` step from there.

    Attributes:
        mesh: "graded" (columns regraded to each site) or "file" (the mesh of the recording file).
        counts: elements of a graded mesh.
        core: half-width of its fine part, m.
        ratio: far over near spacing.
        compression: how many times faster than life the probe is run; 10 for first looks, 5 for final fits.
        interval: length of an output frame, s of real time; sensors are read by interpolation between frames.
        step: longest time step on the simulated clock, s; elements whose own bound is lower get mass (see `safety`).
        safety: share of an element's critical step that is used.
        hourglass: hourglass stiffness over shear modulus.
        penalty: contact pressure per penetration, Pa/m.
        softness: length over which contact sets in, m.
        damping: mass damping over the first shear frequency of the tissue under the probe.
        stiffness_damping: forces are taken at u + beta v, s: quiets tangents.
        smoothing: width of the Gaussian that smooths the recorded path, s.
        margin: the contact patch reaches this far beyond the probe's radius and path, m.
        nearest_node: markers on the nearest node instead of their place in a facet.
        precision: "float32" or "float64".
        processes: that simulate recordings side by side; 1 stays in this process.
        tangents: columns of the Jacobian per program.
    """

    mesh: str = "graded"
    counts: tuple[int, int, int] = (16, 16, 6)
    core: float = 0.008
    ratio: float = 3.0
    compression: float = 5.0
    interval: float = 0.016
    step: float = 2.0e-4
    safety: float = 0.7
    hourglass: float = 0.3
    penalty: float = 5e8
    softness: float = 5e-6
    damping: float = 0.5
    stiffness_damping: float = 5e-5
    smoothing: float = 0.04
    margin: float = 0.006
    nearest_node: bool = False
    precision: str = "float32"
    processes: int = 2
    tangents: int = 3

    def __post_init__(self):
        if self.mesh not in MESHES:
            raise unknown("mesh choice", self.mesh, MESHES)
        if self.precision not in ("float32", "float64"):
            raise unknown("precision", self.precision, ("float32", "float64"))
        for name in ("compression", "interval", "step", "penalty", "softness", "processes", "tangents"):
            if not getattr(self, name) > 0:
                raise InputError(f"probing setting {name} = {getattr(self, name)}: it must be positive")

    @property
    def steps(self) -> int:
        """Steps a frame."""
        return max(1, -(-round(self.interval / self.compression * 1e9) // round(self.step * 1e9)))

    def changed(self, **what) -> "ProbingSettings":
        """A copy with some choices replaced.

        Raises:
            InputError: an unknown choice.
        """
        for name in what:
            if name not in self.__dataclass_fields__:
                raise unknown("probing setting", name, self.__dataclass_fields__)
        return replace(self, **what)

    @property
    def coarse(self) -> "ProbingSettings":
        """Twice as fast again, for scores and the numerical error."""
        return self.changed(compression=2 * self.compression)

    @property
    def swift(self) -> "ProbingSettings":
        """Four times as fast, for the descent of a fit, unless that is beyond `SWIFT`: then twice."""
        return self.changed(compression=min(4 * self.compression, max(SWIFT, 2 * self.compression)))

    @property
    def finer(self) -> "ProbingSettings":
        """Elements smaller by a factor of about 1.35 (`REFINED`), the last step of a fit."""
        return self.changed(mesh="graded", counts=tuple(round(REFINED * n) for n in self.counts))
