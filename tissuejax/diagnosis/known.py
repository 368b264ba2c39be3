"""Physics that the base model has already: known effects, stated with their values or fitted along with the energy.

What is stated is no candidate any more. A value given is kept; what else the effect's form has is fitted with the base.
So a model that a diagnosis repaired is diagnosed again, and weight is stated instead of looked for.
"""

from collections.abc import Mapping, Sequence

from tissuejax.diagnosis.bench import Bench, Candidate
from tissuejax.effects.catalogue import effects
from tissuejax.errors import InputError, unknown

Known = dict[str, dict[str, float]]  # by effect, the parameters whose values are given


def known_physics(given: Sequence[str], kind: str) -> Known:
    """What was stated, by effect.

    Args:
        given: "NAME" or "NAME.PARAMETER=VALUE" each.
        kind: of the experiments.

    Raises:
        InputError: an effect that can't act in such experiments, an unknown parameter, or a value that is no number.
    """
    found: Known = {}
    for item in given:
        path, _, text = item.removeprefix("effects.").partition("=")
        name, _, parameter = path.partition(".")
        if name not in effects(kind):
            raise unknown("effect", name, sorted(effects(kind)))
        values = found.setdefault(name, {})
        if not parameter and not text:
            values |= effects(kind)[name].standard
            continue
        try:
            values[parameter] = float(text)
        except ValueError as error:
            raise InputError(f"{item!r}: expected NAME, or NAME.PARAMETER=NUMBER in SI units") from error
    return found


def tell(bench: Bench, known: Known) -> None:
    """Make known physics part of a bench's base model.

    Raises:
        InputError: an unknown parameter of a known effect.
    """
    for name, values in known.items():
        forms = [c for c in bench.candidates.values() if c.name == name]
        given = {f"effects.{name}.{p}": v for p, v in values.items()}
        declared = {d.name for d in effects()[name]().parameters}
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
        bench.candidates = {k: c for k, c in bench.candidates.items() if c.name != name}


def _form(forms: Sequence[Candidate], given: Mapping[str, float]) -> Candidate | None:
    """The first form that is tried, or the smallest that holds all that is given."""
    holding = [c for c in forms if set(given) <= set(c.paths)]
    if given and holding:
        return min(holding, key=lambda c: len(c.paths))
    return next((c for c in forms if c.nominated), None) if not given else None


def label(energy: str, known: Known) -> str:
    """The base model in words: "reduced-polynomial-2 with gravity"."""
    return f"{energy} with {' and '.join(known)}" if known else energy
