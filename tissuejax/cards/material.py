"""What is to be exported: an energy with its constants, a volumetric energy, a Prony series, in one set of units."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from tissuejax.energies.catalogue import name_of
from tissuejax.energies.energy import Energy
from tissuejax.energies.ogden import FORMS, Ogden
from tissuejax.energies.polynomial import Polynomial
from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Compressibility, Volumetric
from tissuejax.errors import InputError, unknown
from tissuejax.model import Model
from tissuejax.parameters import under

RIG = 0  # order of effects that belong to the rig and the sensor, not to the tissue
PENALTY = 1000.0  # bulk over shear modulus where a solver can't take an incompressible material: Poisson's ratio 0.4995


POWERS, LOGARITHM = "sum_i (J-1)^(2i) / D_i", "K/2 ln(J)^2"  # volumetric energies of the cards
SAME = {"quadratic": (POWERS,), "compressibility": (POWERS,), "logarithmic": (LOGARITHM,)}


@dataclass(frozen=True)
class Units:
    """A consistent set: what one Pa, one kg/m^3 and one second are in it, and their names."""

    name: str
    stress: float
    density: float
    names: str


UNITS = {
    u.name: u
    for u in (
        Units("m-kg-s", 1.0, 1.0, "m, kg, s, N, Pa"),
        Units("mm-t-s", 1e-6, 1e-12, "mm, t, s, N, MPa"),
        Units("mm-g-ms", 1e-6, 1e-6, "mm, g, ms, N, MPa"),
    )
}
TIMES = {"mm-g-ms": 1e3}


@dataclass(frozen=True)
class Material:
    """A material in the units of the card.

    Attributes:
        name: for the card, without blanks.
        energy: the strain energy (its structure; constants are in `constants`).
        constants: of the energy, by name.
        volumetric: the volumetric energy, None for incompressible.
        bulk: its constants, by name.
        prony: (g_i, tau_i), shares of the INSTANTANEOUS stiffness; `constants` are instantaneous ones.
        density: None if not known.
        units: the set they are all in.
        notes: what was left out or changed, for the comments of a card.
    """

    name: str
    energy: Energy
    constants: Mapping[str, float]
    volumetric: Volumetric | None
    bulk: Mapping[str, float]
    prony: tuple[tuple[float, float], ...] = ()
    density: float | None = None
    units: Units = UNITS["m-kg-s"]
    notes: tuple[str, ...] = ()

    @property
    def shear_modulus(self) -> float:
        """At rest, instantaneous."""
        return float(self.energy.initial_shear_modulus(self.constants))

    @property
    def bulk_modulus(self) -> float | None:
        """At rest; None for incompressible."""
        return None if self.volumetric is None else float(self.volumetric.bulk_modulus(self.bulk))

    def penalty(self) -> tuple[float, str]:
        """A bulk modulus for solvers that need one, and the sentence that says where it comes from."""
        if self.volumetric is not None:
            K = float(self.volumetric.bulk_modulus(self.bulk))
            return K, f"bulk modulus K = {K:.6g}, {self.volumetric.formula}"
        K = PENALTY * self.shear_modulus
        return K, f"incompressible as fitted; K = {K:.6g} is a penalty of {PENALTY:g} shear moduli, not a measurement"

    def compressibilities(self, most: int) -> list[float]:
        """D_1 ... of sum_i (J-1)^(2i) / D_i, ABAQUS's form; [0.0] is incompressible.

        Raises:
            InputError: more terms than `most`.
        """
        if isinstance(self.volumetric, Compressibility):
            found = [float(self.bulk[f"D{i}"]) for i in range(1, self.volumetric.order + 1)]
            if len(found) > most:
                raise InputError(f"{len(found)} compressibilities D_i; this card takes {most} with this energy")
            return found
        K = self.bulk_modulus
        return [0.0] if K is None else [2 / K]

    def volume_note(self, theirs: str) -> str:
        """A remark where the volumetric energy of the card is another function than the one fitted."""
        if self.volumetric is None or theirs in SAME.get(self.volumetric.name, ()):
            return ""
        return (
            f"fitted with U = {self.volumetric.formula}; card has U = {theirs}: same K, equal to first order in J - 1"
        )

    def ogden(self, form: str) -> list[tuple[float, float]] | None:
        """(mu_i, alpha_i) in the named form, or None for another kind of energy."""
        if not isinstance(self.energy, Ogden):
            return None
        own, theirs = FORMS[self.energy.form].factor, FORMS[form].factor
        found = []
        for i in range(1, self.energy.order + 1):
            mu, alpha = float(self.constants[f"mu{i}"]), float(self.constants[f"alpha{i}"])
            found.append((mu * own(alpha) / theirs(alpha), alpha))
        return found

    def polynomial(self) -> dict[tuple[int, int], float] | None:
        """C_ij of sum C_ij (I1bar - 3)^i (I2bar - 3)^j, or None for another kind of energy."""
        c = self.constants
        if self.energy.name == "neo-hookean":
            return {(1, 0): 0.5 * float(c["mu"])}
        if self.energy.name == "mooney-rivlin":
            return {(1, 0): float(c["C10"]), (0, 1): float(c["C01"])}
        if isinstance(self.energy, Polynomial):
            return {(i, j): float(c[f"C{i}{j}"]) for i, j in self.energy.exponents}
        if isinstance(self.energy, ReducedPolynomial):
            return {(i, 0): float(c[f"C{i}0"]) for i in range(1, self.energy.order + 1)}
        return None


def material(
    model: Model,
    values: Mapping[str, float],
    name: str = "tissue",
    density: float | None = None,
    units: str = "m-kg-s",
    bulk: float | None = None,
) -> Material:
    """A material for export, from a model and its values in SI.

    Effects of the rig and the sensor are left out with a note: they belong to the recording. Relaxation goes into the
    Prony series. Any other effect of the tissue that acts has no card anywhere.

    Args:
        density: kg/m^3.
        units: a name of `UNITS`.
        bulk: Pa; makes an incompressible fit slightly compressible, U = K/2 (J-1)^2.

    Raises:
        InputError: an effect with no card, a law of relaxation that no card knows, an unknown set of units, a bulk
            modulus for a model that has one.
    """
    if units not in UNITS:
        raise unknown("set of units", units, UNITS)
    prony, notes = (), []
    for effect in model.effects:
        own = under(f"effects.{effect.name}", values)
        acting = any(float(v) != 0 for p, v in own.items() if p.partition(".")[0] in effect.amplitudes)
        if not acting:
            continue
        if effect.name.startswith("viscoelasticity"):
            if float(own.get("moduli", 0)) or float(own.get("nominal", 0)):
                raise InputError(
                    "the fitted relaxation is that of the moduli or of the nominal stress; solvers relax the stress of "
                    "the material itself: fit with effects.viscoelasticity.moduli = 0 and nominal = 0"
                )
            series = zip(effect.amplitudes, (a.replace("g", "tau") for a in effect.amplitudes), strict=True)
            prony = tuple((float(own[g]), float(own[tau])) for g, tau in series if float(own[g]) != 0)
        elif effect.order == RIG:
            notes.append(f"{effect.name} belongs to the rig and is left out")
        else:
            raise InputError(
                f"the fitted effect {effect.name} has no card in any of these solvers; export a fit without it, or set "
                "its amplitude to 0"
            )
    u = UNITS[units]
    volumetric = model.volumetric
    constants, own_bulk = under("energy", values), under("volumetric", values)
    if bulk is not None:
        if volumetric is not None:
            raise InputError("a bulk modulus was given, but the model has one; leave --bulk out")
        from tissuejax.energies.catalogue import volumetric as named

        volumetric, own_bulk = named("quadratic"), {"K": float(bulk)}
        notes.append("the bulk modulus was given at export, not fitted")
    scale = {"Pa": u.stress, "1/Pa": 1 / u.stress}
    seconds = TIMES.get(units, 1.0)
    return Material(
        name.replace(" ", "-"),
        model.energy,
        {p.name: float(constants[p.name]) * scale.get(p.unit, 1.0) for p in model.energy.parameters},
        volumetric,
        {} if volumetric is None else {p.name: float(own_bulk[p.name]) * scale[p.unit] for p in volumetric.parameters},
        tuple((g, tau * seconds) for g, tau in prony),
        None if density is None else density * u.density,
        u,
        tuple(notes),
    )


def noted(subject: Material, *more: str) -> Material:
    """The same with further notes; empty ones are dropped."""
    return replace(subject, notes=(*subject.notes, *(m for m in more if m)))


def described(subject: Material) -> list[str]:
    """Lines for the head of every card: what it is, in which form and units."""
    e = subject.energy
    lines = [f"{subject.name}: {name_of(e)}, psi = {e.formula}", f"units {subject.units.names}"]
    if isinstance(e, Ogden):
        lines.append(f"fitted in Ogden form {e.form}")
    if subject.volumetric is None:
        lines.append("fitted as incompressible")
    if subject.prony:
        lines.append("fitted moduli are instantaneous; shares g_i of them relax with tau_i")
    return lines + [f"NOTE {note}" for note in subject.notes]
