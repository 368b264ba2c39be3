"""Arguments that several commands share, and the small languages in them: `path=value unit`, `path=low:high`."""

import argparse
import math
from collections.abc import Mapping
from pathlib import Path

from tissuejax.errors import InputError, unknown
from tissuejax.fitting.options import Objective, Search, Unknowns
from tissuejax.parameters import Parameter
from tissuejax.units import quantity


def add_model(parser: argparse._ActionsContainer, required: bool = True) -> None:
    """--energy and what goes with it."""
    parser.add_argument(
        "--energy",
        "-e",
        required=required,
        metavar="NAME",
        help="strain energy, e.g. neo-hookean, reduced-polynomial-3, ogden-2, demiray+fibre; see `tissuejax energies`",
    )
    parser.add_argument(
        "--ogden-form", metavar="FORM", help="what Ogden constants mean: mu/alpha, 2mu/alpha, 2mu/alpha^2, c/m^2"
    )
    parser.add_argument(
        "--volumetric", metavar="NAME", help="quadratic, logarithmic or compressibility-N; left out: incompressible"
    )
    parser.add_argument(
        "--effect", action="append", default=[], metavar="NAME", help="switch an effect on, e.g. viscoelasticity"
    )


def add_fit(parser: argparse._ActionsContainer, multistart: int = 4) -> None:
    """What can be said about a fit; `multistart` is the default."""
    parser.add_argument(
        "--only", action="append", default=[], metavar="RECORDING", help="fit this recording (repeat for more)"
    )
    parser.add_argument("--holdout", action="append", default=[], metavar="RECORDING", help="predict it, don't fit it")
    parser.add_argument("--free", action="append", metavar="PATH", help="estimate just these parameters")
    parser.add_argument(
        "--fix", action="append", default=[], metavar="PATH=VALUE", help='hold a parameter, e.g. "energy.C20=0"'
    )
    parser.add_argument(
        "--start", action="append", default=[], metavar="PATH=VALUE", help='begin here, e.g. "energy.mu=3 kPa"'
    )
    parser.add_argument(
        "--bounds", action="append", default=[], metavar="PATH=LOW:HIGH", help="allowed range, either end may be empty"
    )
    parser.add_argument(
        "--prior", action="append", default=[], metavar="PATH=MEAN:STD", help="what is known beforehand"
    )
    parser.add_argument(
        "--weights",
        default="auto",
        metavar="KIND",
        help="auto: recorded noise, else one estimate (default); uniform; relative: each channel by its size",
    )
    parser.add_argument(
        "--channel", action="append", default=[], metavar="NAME", help="fit this channel only, e.g. force"
    )
    parser.add_argument(
        "--loss", default="squares", metavar="KIND", help="squares (default), soft-l1 or cauchy (robust to outliers)"
    )
    parser.add_argument(
        "--method",
        default="levenberg-marquardt",
        metavar="NAME",
        help="levenberg-marquardt (default), adam, lbfgs; for one probing also stress-curve",
    )
    parser.add_argument(
        "--multistart", type=int, default=multistart, metavar="N", help=f"number of starts (default {multistart})"
    )
    parser.add_argument(
        "--max-steps", type=int, default=200, metavar="N", help="evaluations for each start (default 200)"
    )
    parser.add_argument("--seed", type=seed, default=0, help="of the further starts (default 0)")
    parser.add_argument(
        "--stable", action="store_true", help="keep the energy stable (Drucker) over the recorded stretches"
    )


def fit_options(given: argparse.Namespace, declared: Mapping[str, Parameter], checkpoint: Path | None = None) -> dict:
    """The keyword arguments of `tj.fit` from what was typed; `checkpoint` keeps a probing's last iterate."""
    return {
        "only": given.only,
        "holdout": given.holdout,
        "unknowns": Unknowns(
            free=tuple(given.free) if given.free is not None else None,
            fix=values(given.fix, declared, "--fix"),
            start=values(given.start, declared, "--start"),
            bounds=ranges(given.bounds, declared, "--bounds"),
            priors=ranges(given.prior, declared, "--prior"),
            stable=given.stable,
        ),
        "objective": Objective(given.weights, tuple(given.channel), given.loss),
        "search": Search(
            given.method,
            positive(given.multistart, "--multistart"),
            given.seed,
            positive(given.max_steps, "--max-steps"),
            checkpoint,
        ),
    }


def values(given: list[str], declared: Mapping[str, Parameter], option: str) -> dict[str, float]:
    """`PATH=VALUE` pairs; a value may carry a unit, without one it is SI."""
    found = {}
    for text in given:
        path, parameter, rest = _parted(text, declared, option, found)
        found[path] = number(rest, parameter, f"{option} {text}")
    return found


def ranges(given: list[str], declared: Mapping[str, Parameter], option: str) -> dict[str, tuple[float, float]]:
    """`PATH=A:B` pairs of numbers; an empty end is infinite."""
    found = {}
    for text in given:
        path, parameter, rest = _parted(text, declared, option, found)
        low, colon, high = rest.partition(":")
        if not colon:
            raise InputError(f"{option} {text}: wanted is PATH=A:B, e.g. {path}=0:5 kPa")
        what = f"{option} {text}"
        found[path] = (
            number(low, parameter, what) if low.strip() else -math.inf,
            number(high, parameter, what) if high.strip() else math.inf,
        )
    return found


def number(text: str, parameter: Parameter, what: str) -> float:
    """A number in the parameter's SI unit, or with a unit of its own."""
    text = text.strip()
    try:
        value = float(text)
    except ValueError:
        return quantity(text, parameter.unit, what)
    if math.isnan(value):
        raise InputError(f"{what}: found no number, wanted is one, such as 12.5 {parameter.unit}")
    return value


def seed(text: str) -> int:
    """A seed as argparse reads it: a whole number from 0 on."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"found {text!r}, expected a whole number from 0 on")
    return int(text)


def positive(value: int, option: str) -> int:
    """A count of at least one."""
    if value < 1:
        raise InputError(f"{option} {value}: it must be 1 or more")
    return value


def _parted(text: str, declared: Mapping[str, Parameter], option: str, found: Mapping) -> tuple[str, Parameter, str]:
    path, equals, rest = text.partition("=")
    path = path.strip()
    if not equals:
        raise InputError(f"{option} {text}: wanted is PATH=VALUE, e.g. {next(iter(declared))}=1000")
    if path not in declared:
        raise unknown("parameter", path, declared)
    if path in found:
        raise InputError(f"{option} {path}: given twice")
    return path, declared[path], rest
