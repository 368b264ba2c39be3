"""The source's own materials, by name, as data: energy, form, constants and where they are printed.

The Ogden numbers are in ABAQUS's form, which produced them, whatever the text around them writes: only there do
the three ex vivo models agree on a small-strain modulus of 70 to 123 Pa.
"""

from dataclasses import dataclass, field

from tissuejax.energies.catalogue import energy, volumetric
from tissuejax.energies.energy import Energy
from tissuejax.energies.volumetric import Volumetric
from tissuejax.errors import unknown

ABAQUS = "2mu/alpha^2"


@dataclass(frozen=True)
class Published:
    """A material as published.

    Attributes:
        name: as on the command line.
        energy_name, ogden_form: as `catalogue.energy` takes them.
        constants: of the energy, by name, SI.
        where: the place in the source.
        volumetric_name, volumetric_constants: where the source gives them; None is incompressible.
        note: what to know before using it.
    """

    name: str
    energy_name: str
    constants: dict[str, float]
    where: str
    ogden_form: str | None = None
    volumetric_name: str | None = None
    volumetric_constants: dict[str, float] = field(default_factory=dict)
    note: str = ""

    @property
    def energy(self) -> Energy:
        """The strain energy."""
        return energy(self.energy_name, self.ogden_form)

    @property
    def volumetric(self) -> Volumetric | None:
        """The volumetric energy, or None."""
        return None if self.volumetric_name is None else volumetric(self.volumetric_name)

    @property
    def values(self) -> dict[str, float]:
        """All constants by dotted path (`energy.mu1`, `volumetric.D1`)."""
        values = {f"energy.{name}": value for name, value in self.constants.items()}
        return values | {f"volumetric.{name}": value for name, value in self.volumetric_constants.items()}


def published(name: str) -> Published:
    """The published material called `name`.

    Raises:
        InputError: an unknown name.
    """
    if name not in PUBLISHED:
        raise unknown("published material", name, PUBLISHED)
    return PUBLISHED[name]


def _ogden(*terms: tuple[float, float]) -> dict[str, float]:
    return {f"{k}{i}": v for i, term in enumerate(terms, 1) for k, v in zip(("mu", "alpha"), term)}


PUBLISHED: dict[str, Published] = {
    material.name: material
    for material in (
        Published(
            "ex-vivo-ogden",
            "ogden-4",
            _ogden((7505.68, -2.773), (0.155, 19.668), (-13856.8, -3.644), (6421.31, -4.515)),
            "Lister 2012, table 2.3 (ex vivo)",
            ABAQUS,
        ),
        Published(
            "ex-vivo-log",
            "log-ogden",
            {"C1": 60.0, "C2": 0.632, "alpha": -2.544},
            "Lister 2012, table 2.1 (combined log-Ogden)",
            note="ends near a compression to stretch 0.6",
        ),
        Published(
            "ex-vivo-exp",
            "exp-ogden",
            {"C1": 10.0, "C2": 1.6, "alpha": -3.068},
            "Lister 2012, table 2.1 (combined exp-Ogden)",
            note="with the '- 3' that the table leaves out",
        ),
        Published(
            "in-vivo-1",
            "ogden-2",
            _ogden((1818.67, 3.277), (4.752, -10.014)),
            "Lister 2012, table 2.3 (in vivo 1)",
            ABAQUS,
        ),
        Published(
            "in-vivo-2",
            "ogden-3",
            _ogden((-22740.362, 1.911), (12578.797, 3.181), (10686.170, 0.749)),
            "Lister 2012, table 2.3 (in vivo 2)",
            ABAQUS,
        ),
        Published(
            "in-vivo-3",
            "reduced-polynomial-4",
            {"C10": 781.898, "C20": -747.631, "C30": 426.135, "C40": 122.701},
            "Lister 2012, table 2.3 (in vivo 3) and appendix A",
            volumetric_name="compressibility-4",
            volumetric_constants={f"D{i}": 1e-3 for i in (1, 2, 3, 4)},
            note="D1 = D2 = D3 = D4 (eq. 4.19): 1e-3 1/Pa in the code of appendix A, which gives the gravity cube of "
            "4.3.3, but 1e-4 in section 3.2.1",
        ),
    )
}
