"""A challenge specimen as data, and the stress its load cell reports: body, then memory, then rig, then sensor.

From the actuator inwards the drive passes a slip, slack, the rig's spring and the permanent set; from the specimen
outwards the stress passes damage, relaxation, aging, platens, and last the sensor with its drift.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from tissuejax.challenge import memory_laws, rig_laws, stray_laws
from tissuejax.challenge.specimen import Tensors, Trial, axes, gradient, kirchhoff, nominal, settle
from tissuejax.challenge.strain_laws import Body
from tissuejax.errors import NotConverged

DRAINING = 100  # rounds of pressure and volume at most
History = Float[np.ndarray, "n ..."]


@dataclass(frozen=True)
class Ingredient:
    """One effect in a specimen.

    Attributes:
        name: as the diagnosis would call it; for happenings outside its catalogue, a name of their own.
        law: which of the effect's laws.
        amount: its strength; zero is none.
        shape: the law's other numbers.
    """

    name: str
    law: str
    amount: float
    shape: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Specimen:
    """Base body and what comes on top."""

    body: Body
    ingredients: tuple[Ingredient, ...] = ()

    def only(self, *names: str) -> "Specimen":
        """With just the named ingredients."""
        return replace(self, ingredients=tuple(i for i in self.ingredients if i.name in names))

    def scaled(self, name: str, amount: float) -> "Specimen":
        """With another strength of one ingredient."""
        return replace(
            self, ingredients=tuple(replace(i, amount=amount) if i.name == name else i for i in self.ingredients)
        )

    def get(self, name: str) -> Ingredient | None:
        """The ingredient called `name`, if it is in."""
        return next((i for i in self.ingredients if i.name == name), None)


def modulus(body: Body) -> float:
    """Small-strain shear modulus of the base, Pa: slope of simple shear at rest."""
    step = 1e-5
    _, S = body.law(np.eye(3))((lambda F: np.swapaxes(F, 1, 2) @ F)(gradient("simple-shear", np.array([step]), 0, 0)))
    return float(S[0, 0, 1] / step + (S[0, 1, 1] - S[0, 2, 2]))


def reported(specimen: Specimen, trial: Trial) -> History:
    """Nominal stress that would be recorded without noise, Pa."""
    strain = trial.strain
    if loose := specimen.get("slip-event"):
        shift = stray_laws.slip_event(trial, loose.amount, **loose.shape)
        strain = strain + (shift if strain.ndim == 1 else shift[:, None])
    shear = trial.kind == "simple-shear"
    drive = strain if shear else np.exp(strain)
    if gap := specimen.get("slack"):
        drive = trial.rest + rig_laws.slack(drive - trial.rest, gap.law, gap.amount)
    if spring := specimen.get("machine-compliance"):

        def give(P: History) -> History:
            return rig_laws.rig_strain(P, spring.law, spring.amount, trial.area, trial.height, **spring.shape)

        _, P = rig_laws.through_spring(drive, lambda x: specimen_stress(specimen, trial, x), give)
    else:
        P = specimen_stress(specimen, trial, drive)
    return sensed(specimen, trial, P)


def specimen_stress(specimen: Specimen, trial: Trial, drive: History) -> History:
    """Nominal stress of the specimen itself, platens included, Pa, over the history of its drive."""
    body, frame = _bodily(specimen), axes(trial.direction)
    mu = modulus(body)
    shear = trial.kind == "simple-shear"
    strain = drive if shear else np.log(drive)
    seen = drive
    if lasting := specimen.get("permanent-set"):
        strain = strain - memory_laws.set_strain(strain, lasting.law, lasting.amount, **lasting.shape)
        seen = strain if shear else np.exp(strain)
    law = body.law(frame)

    def stress(F: Tensors) -> Tensors:
        return law(np.swapaxes(F, 1, 2) @ F)[1]

    ln_J, skew = settle(trial, seen, stress, body.bulk, body.fibrous, mu)
    F = gradient(trial.kind, seen, ln_J, skew)
    if (leak := specimen.get("compressibility")) and leak.law == "drained":
        for _ in range(DRAINING):
            push = kirchhoff(F, stress(F))[:, 2, 2]
            before, ln_J = ln_J, memory_laws.drained(trial.time, push, mu / leak.amount, **leak.shape)
            ln_J = before + 0.6 * (ln_J - before)  # without it a soft specimen overshoots, from loss to gain and back
            _, skew = settle(trial, seen, stress, None, body.fibrous, mu, ln_J)
            F = gradient(trial.kind, seen, ln_J, skew)
            if np.max(np.abs(ln_J - before)) < 1e-9:
                break
        else:
            raise NotConverged(f"{trial.name}: volume and pressure of a draining specimen don't meet")
    W, S = law(np.swapaxes(F, 1, 2) @ F)
    size = strain if strain.ndim == 1 else np.max(np.abs(strain), -1)
    if damage := specimen.get("softening"):
        S = S * memory_laws.softening(W, size, damage.law, damage.amount, **damage.shape)[:, None, None]
    slow = specimen.get("viscoelasticity")
    if slow and slow.law != "nominal":
        S = relaxed(slow, trial, S, size)
    P = nominal(trial.kind, F, S)
    if slow and slow.law == "nominal":
        P = relaxed(slow, trial, P, size)
    factor = np.ones(len(P))
    if old := specimen.get("aging"):
        factor = factor * rig_laws.aging_factor(trial, old.law, old.amount, **old.shape)
    if (plate := specimen.get("platen-friction")) and trial.kind == "uniaxial":
        factor = factor * rig_laws.platen_factor(drive, plate.law, plate.amount, trial.diameter, trial.height)
    return P * factor.reshape(-1, *([1] * (P.ndim - 1)))


def relaxed(slow: Ingredient, trial: Trial, s: History, size: Float[np.ndarray, " n"]) -> History:
    """`s` after the relaxation that `slow` describes."""
    shape = slow.shape
    if slow.law == "spectrum":
        g, tau = memory_laws.power_spectrum(slow.amount, shape["fastest"], shape["slowest"], shape["exponent"])
        return memory_laws.prony(trial.time, s, g, tau)
    g = [slow.amount * share for share in shape["shares"]]
    if slow.law == "strained":
        return memory_laws.prony_strained(trial.time, s, size, g, shape["tau"], shape["b"])
    return memory_laws.prony(trial.time, s, g, shape["tau"])


def sensed(specimen: Specimen, trial: Trial, P: History) -> History:
    """What the load cell makes of the stress `P`."""
    column = (-1, *([1] * (P.ndim - 1)))
    for stray in specimen.ingredients:
        if stray.name == "torn":
            P = stray_laws.torn(trial, P, stray.amount, **stray.shape)
        elif stray.name == "shock":
            P = P + stray_laws.shock(trial, stray.amount, **stray.shape).reshape(column)
        elif stray.name == "bumped":
            P = P + stray_laws.bumped(trial, stray.amount, **stray.shape).reshape(column)
        elif stray.name == "slew":
            P = stray_laws.slew(trial, P, stray.amount)
        elif stray.name == "cured":
            P = stray_laws.cured(trial, P, stray.amount, **stray.shape)
        elif stray.name == "stick-slip":
            P = P + stray_laws.stick_slip(trial, stray.amount, **stray.shape)
        elif stray.name == "flicker":
            P = stray_laws.flicker(P, stray.amount, np.random.default_rng([stray.shape["seed"], len(trial.time)]))
        elif stray.name == "drift":
            P = P + rig_laws.drift(trial, stray.law, *(stray.amount * np.array(stray.shape["mix"]))).reshape(column)
        elif stray.name == "periodic":
            P = P + rig_laws.periodic(trial, stray.law, stray.amount, **stray.shape).reshape(column)
        elif stray.name == "spikes":
            rng = np.random.default_rng([stray.shape["seed"], len(trial.time)])
            P = P + stray_laws.spikes(len(P), stray.amount, stray.shape["share"], rng).reshape(column)
    if late := specimen.get("skipped"):
        P = stray_laws.skipped(trial, P, late.amount, **late.shape)
    if still := specimen.get("frozen"):
        P = stray_laws.frozen(trial, P, still.amount, **still.shape)
    if coarse := specimen.get("stepped"):
        P = stray_laws.stepped(P, coarse.amount)
    return P


def _bodily(specimen: Specimen) -> Body:
    """The body with those ingredients that are part of its energy; amounts are shares of the base's modulus."""
    body, mu = specimen.body, modulus(specimen.body)
    for i in specimen.ingredients:
        if i.name == "compressibility" and i.law == "bulk":
            body = replace(body, bulk=mu / i.amount)
        elif i.name == "anisotropy":
            fibre = {"k": i.amount * mu, "kind": i.law, **i.shape}
            body = replace(body, extra=(*body.extra, ("fibres", fibre)))
        elif i.name in ("energy-form", "slightly-wrong"):
            if i.law in ("c01", "c30", "c11"):
                terms = dict(body.terms)
                terms[i.law[1:]] = terms.get(i.law[1:], 0.0) + i.amount * mu
                body = replace(body, terms=terms)
            else:
                key = "a" if i.law == "exponential" else "mu"
                size = [i.amount * mu] if i.law == "ogden" else i.amount * mu
                body = replace(body, extra=(*body.extra, (i.law, {key: size, **i.shape})))
    return body
