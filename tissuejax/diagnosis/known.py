"""Physics that the base model has already: known effects, stated with their values or fitted along with the energy.

What is stated is no candidate any more. A value given is kept; what else the effect's form has is fitted with the base.
So a model that a diagnosis repaired is diagnosed again, and weight is stated instead of looked for. A cut holds no
stiffness of its tissue: the constants that another test found are stated likewise ("energy.mu=3 kPa").
"""

from collections.abc import Mapping, Sequence

from tissuejax.diagnosis.bench import Bench, Candidate
from tissuejax.effects.catalogue import declared as declared_of
from tissuejax.effects.catalogue import effects
from tissuejax.errors import InputError, unknown
from tissuejax.units import quantity

Known = dict[str, dict[str, float]]  # by effect (or room of the tissue's constants), the parameters that are given
TISSUE = ("energy", "volumetric")  # rooms of constants


def known_physics(given: Sequence[str], kind: str) -> Known:
    """What was stated, by effect.

    Args:
        given: "NAME" or "NAME.PARAMETER=VALUE" each, numbers in SI or with their unit.
        kind: of the experiments.

    Raises:
        InputError: an effect that can't act in such experiments, an unknown parameter, or a value that is no number.
    """
    found: Known = {}
    for item in given:
        path, _, text = item.removeprefix("effects.").partition("=")
        name, _, parameter = path.partition(".")
        if name in TISSUE:
            if kind != "cutting" or not parameter or not text:
                raise InputError(
                    f"{item!r}: the tissue's own constants are told for cuts, as energy.mu=3kPa; where stress or a "
                    "probe's force was recorded, a diagnosis fits them"
                )
        elif name not in effects(kind):
            raise unknown("effect", name, sorted(effects(kind)))
        elif not declared_of(name):
            raise InputError(
                f"{item!r}: {name} has no parameters that could be stated: it is a part of what any law leaves, which "
                "every diagnosis weighs; leave it out of what is known"
            )
        values = found.setdefault(name, {})
        if parameter or text:
            values[parameter] = _number(item, name, parameter, text)
        else:
            values |= effects(kind)[name].standard
    return found


def _number(item: str, name: str, parameter: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        units = {} if name in TISSUE else {k: d.unit for k, d in declared_of(name).items()}
        unit = units.get(parameter, "Pa" if name in TISSUE else "1")
    try:
        return quantity(text, unit, item.partition("=")[0])
    except InputError as error:
        raise InputError(
            f"{item!r}: expected NAME, or NAME.PARAMETER=NUMBER in SI units or with one ({error})"
        ) from None


def tell(bench: Bench, known: Known) -> None:
    """Make known physics part of a bench's base model.

    Raises:
        InputError: an unknown parameter of a known effect.
    """
    for name in TISSUE:
        given = {f"{name}.{p}": v for p, v in known.get(name, {}).items()}
        for path in given:
            if path not in bench.start:
                raise unknown("constant of the tissue", path, [p for p in bench.start if p.startswith(TISSUE)])
        bench.known |= given
        bench.start |= given
        bench.base = tuple(p for p in bench.base if p not in given)
    for name, values in effects_of(known).items():
        forms = [c for c in bench.candidates.values() if c.name == name and not c.widens]
        given = {f"effects.{name}.{p}": v for p, v in values.items()}
        declared = set(declared_of(name))
        for path, p in zip(given, values, strict=True):
            if path not in bench.start and p not in declared:
                raise unknown(f"parameter of {name}", p, sorted(declared))
        form = _form(forms, given)
        left = [p for p in form.paths if p not in given] if form else []
        for path in (p for p in left if form.grid and p in form.grid[0]):
            bench.start[path] = form.grid[0][path]
        bench.known |= given
        bench.start |= given
        bench.base = (*bench.base, *left)
        # a law of no form in the catalogue is not stated by the values of one that is
        bench.candidates = {k: c for k, c in bench.candidates.items() if c.name != name or c.widens}


def _form(forms: Sequence[Candidate], given: Mapping[str, float]) -> Candidate | None:
    """The first form that is tried, or the smallest that holds all that is given."""
    holding = [c for c in forms if set(given) <= set(c.paths)]
    if given and holding:
        return min(holding, key=lambda c: len(c.paths))
    return next((c for c in forms if c.nominated), None) if not given else None


def effects_of(known: Known) -> Known:
    """The effects among known physics, without the tissue's constants."""
    return {name: values for name, values in known.items() if name not in TISSUE}


def label(energy: str, known: Known) -> str:
    """The base model in words: "reduced-polynomial-2 with gravity", "neo-hookean (mu 3000 given) with settling"."""
    told = ", ".join(f"{p} {v:.4g}" for name in TISSUE for p, v in known.get(name, {}).items())
    more = " and ".join(effects_of(known))
    return energy + f" ({told} given)" * bool(told) + f" with {more}" * bool(more)
