"""Reading back what a fit wrote: the model and its values, and the same from a published material or from options."""

import argparse
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tissuejax import verbs
from tissuejax.commands.arguments import values as valued
from tissuejax.commands.outputs import effects_of
from tissuejax.energies.published import published
from tissuejax.errors import InputError
from tissuejax.model import Model
from tissuejax.parameters import checked, under

NOT_A_RESULT = "not a result.json of `tissuejax fit`"
FAULTS = (ValueError, KeyError, TypeError, AttributeError)  # of reading a record that is another's


@dataclass(frozen=True)
class Known:
    """A model with a value for every parameter, SI.

    Attributes:
        name: of the sample or the material.
        model, values: what it is.
        record: the result it came from, {} for a material that was never fitted.
        assumed: constants of the energy that nobody gave: the catalogue's typical values.
    """

    name: str
    model: Model
    values: dict[str, float]
    record: dict
    assumed: tuple[str, ...] = ()

    @property
    def said(self) -> list[str]:
        """A sentence on constants that nobody gave."""
        declared = self.model.parameters
        told = ", ".join(f"{p} = {self.values[p]:.4g} {declared[p].unit}".removesuffix(" 1") for p in self.assumed)
        return [f"not given, so the catalogue's typical values: {told} (--set)"] if told else []


def add_source(parser: argparse.ArgumentParser) -> None:
    """RESULT.json, --published or --energy with --set."""
    parser.add_argument("result", nargs="?", type=Path, metavar="RESULT.json", help="a result of `tissuejax fit`")
    parser.add_argument("--published", metavar="NAME", help="a published material, e.g. in-vivo-3")
    parser.add_argument("--energy", "-e", metavar="NAME", help="an energy by name, its constants by --set")
    parser.add_argument("--ogden-form", metavar="FORM", help="what Ogden constants mean")
    parser.add_argument("--volumetric", metavar="NAME", help="quadratic, logarithmic or compressibility-N")
    parser.add_argument("--effect", action="append", default=[], metavar="NAME", help="an effect to switch on")
    parser.add_argument(
        "--set", action="append", default=[], metavar="PATH=VALUE", help='a value, e.g. "energy.mu=3 kPa" (repeat)'
    )


def known(given: argparse.Namespace) -> Known:
    """The model and values named by the arguments of `add_source`.

    Raises:
        InputError: none or several sources named, a file that is no result, an unknown name.
    """
    named = [given.result, given.published, given.energy]
    if sum(n is not None for n in named) != 1:
        raise InputError(
            "say which material: RESULT.json, or --published NAME, or --energy NAME with --set (one of them)"
        )
    if given.result is not None:
        found = read_result(given.result)
    elif given.published is not None:
        of = published(given.published)
        found = Known(of.name, Model(of.energy, of.volumetric), dict(of.values), {})
    else:
        model = verbs.material(
            given.energy, ogden_form=given.ogden_form, volumetric=given.volumetric, effects=given.effect
        )
        found = Known(given.energy, model, dict(model.defaults), {})
    changed = valued(given.set, found.model.parameters, "--set")
    rooms = ("energy.", "volumetric.")
    own = [p for p in found.model.parameters if p.startswith(rooms)] if given.energy is not None else []
    assumed = tuple(p for p in own if p not in changed)
    values = found.values | checked(changed, found.model.parameters)
    refuse_softening(found.model, values, changed)
    return Known(found.name, found.model, values, found.record, assumed)


def refuse_softening(model: Model, values: Mapping[str, float], told: Mapping[str, float]) -> None:
    """Refuse constants that give a material without a positive shear modulus at rest.

    Raises:
        InputError: which were told, and the modulus.
    """
    named = [p for p in told if p.startswith("energy.")]
    modulus = float(model.energy.initial_shear_modulus(under("energy", values)))
    if named and not modulus > 0:
        raise InputError(
            f"{', '.join(f'{p} = {told[p]:g}' for p in named)}: the shear modulus at rest would be {modulus:.4g} Pa; "
            "it must be positive, or the material has no shape of its own"
        )


def read_result(path: Path) -> Known:
    """The model and values of a result.json.

    Raises:
        InputError: unreadable, or not a result of a fit.
    """
    try:
        record = read_record(path)
        if "verdict" in record:
            again = record.get("fit", "tissuejax fit ... --effect NAME with what it named")
            raise InputError(f"{path}: holds a diagnosis; fit with what it named first ({again}), and give that result")
        energy, parameters = record["energy"], record["parameters"]
        model = verbs.material(
            energy["name"],
            ogden_form=energy["forms"].get("ogden"),
            volumetric=energy["volumetric"],
            effects=effects_of(record),
        )
        values = {path: float(p["value"]) for path, p in parameters.items()}
    except FAULTS as error:
        raise no_result(path, error) from error
    model = model.across(tuple(record["recordings"]))
    left = sorted(set(model.parameters) ^ set(values))
    if left:
        raise InputError(f"{path}: made by another version ({', '.join(left[:4])} differ); fit again")
    return Known(str(record["sample"]), model, values, record)


def read_record(path: Path) -> dict:
    """What a JSON file holds.

    Raises:
        InputError: there is none, or it can't be read.
        ValueError: it is no JSON.
    """
    path = Path(path)
    try:
        return json.loads(path.read_text())
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; wanted is the result.json in the --out of `tissuejax fit`") from None
    except IsADirectoryError:
        raise InputError(f"{path}: found a folder, expected a file: {path / 'result.json'}") from None
    except OSError as error:
        raise InputError(f"{path}: can't be read ({error.strerror})") from error


def no_result(path: Path, error: Exception) -> InputError:
    """That a file is not a fit's record."""
    lacking = f"it has no {error}" if isinstance(error, KeyError) else str(error)
    return InputError(f"{path}: {NOT_A_RESULT} ({lacking}); give the one in its --out")
