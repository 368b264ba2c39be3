"""Where results go: a folder for each verb, sample and model; nothing is overwritten that is something else.

The record that a verb writes says under "made" what it is of. The same command may be given again; another one into the
same folder is refused.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tissuejax.errors import InputError

RECORDS = {  # the file in which a verb says what it made; those with a page share report.html
    "fit": "result.json",
    "diagnosis": "result.json",
    "compare": "comparison.json",
    "campaign": "campaign.json",
    "sensitivity": "sensitivity.json",
    "profile": "profiles.json",
    "posterior": "posterior.json",
    "cut-fit": "result.json",
    "cut-identify": "result.json",
}
KEPT = "checkpoint.json"  # where a fit that simulates stood, until it has ended
WITH_A_PAGE = ("result.json", "comparison.json", "campaign.json")


ENDINGS = {".png", ".svg", ".pdf", ".csv", ".json", ".html", ".h5", ".txt", ".inp", ".xlsx", ".mat"}


def listed(files: Mapping[str, Path]) -> list[str]:
    """Paths for a reader; of the SVG and PDF of every figure one line tells."""
    plain = [str(p) for p in files.values() if p.parent.name != "print"]
    printed = sorted({str(p.parent) for p in files.values() if p.parent.name == "print"})
    return plain + [f"{folder} (the figures as SVG and PDF)" for folder in printed]


def folder_named(text: str) -> Path:
    """What was typed after --out, as argparse reads it: a folder, so no name of a file.

    Raises:
        argparse.ArgumentTypeError: it ends as a file does and is no folder.
    """
    path = Path(text)
    if path.suffix.lower() in ENDINGS and not path.is_dir():
        raise argparse.ArgumentTypeError(f"found {text}, expected a folder: several files are written into it")
    return path


def add_out(parser: argparse.ArgumentParser, default: str) -> None:
    """--out and --force."""
    parser.add_argument("--out", "-o", type=folder_named, metavar="FOLDER", help=f"default: {default}")
    parser.add_argument("--force", action="store_true", help="overwrite another result in --out")


def made(verb: str, sample: str, model: Sequence[str]) -> dict[str, Any]:
    """What a record says of itself under "made"."""
    return {"verb": verb, "sample": sample, "model": list(model)}


def folder(out: Path | None, verb: str, sample: str, model: Sequence[str] = (), force: bool = False) -> Path:
    """The folder to write into: `out`, or out/SAMPLE-VERB-MODEL by default.

    Args:
        out: as the user said, or None.
        verb: a key of `RECORDS`.
        sample, model: what is computed: the energy and the effects, or whatever tells two results of a verb apart.
        force: overwrite whatever is there.

    Raises:
        InputError: the folder holds another result; says which, and what to do.
    """
    place = out or Path("out") / "-".join([sample, verb, *model])
    if not force:
        refuse_other(place, made(verb, sample, model))
    return place


def refuse_other(place: Path, mine: dict[str, Any]) -> None:
    """Refuse a folder whose results this verb would overwrite and that are of something else.

    Raises:
        InputError: says what is there, and what to do.
    """
    own = RECORDS[mine["verb"]]
    for name in WITH_A_PAGE if own in WITH_A_PAGE else (own,):
        path = place / name
        if not path.is_file():
            continue
        there = _told(path)
        if there != _plain(mine):
            what = "a result of another kind"
            if there is not None:
                what = f"the {there[0]} of {there[1]}" + (f" with {' + '.join(there[2])}" if there[2] else "")
            raise InputError(f"{place}: holds {what}; name another folder with --out, or give --force to overwrite it")


def refuse_other_data(place: Path, fitted: Sequence[str], held: Sequence[str]) -> None:
    """Refuse a folder that holds a fit to other recordings of the same sample.

    Raises:
        InputError: says to which, and what to do.
    """
    try:
        record = json.loads((place / "result.json").read_text("utf-8"))
        there = sorted(record["recordings"]), sorted({key.split("/")[0] for key in record["holdout"]})
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return
    if there != (sorted(fitted), sorted(held)):
        held_out = f", {', '.join(there[1])} held out" if there[1] else ""
        raise InputError(
            f"{place}: holds the fit to {', '.join(there[0])}{held_out}; name another folder with --out, or give "
            "--force to overwrite it"
        )


def effects_of(record: dict) -> list[str]:
    """Names of the effects as they are typed, a Prony series with its number of terms."""
    found = []
    for name in record["effects"]:
        terms = sum(p.startswith(f"effects.{name}.g") for p in record["parameters"])
        found.append(f"{name}-{terms}" if name == "viscoelasticity" and terms != 1 else name)
    return found


def _plain(record: dict[str, Any]) -> tuple[str, str, tuple[str, ...]]:
    first, *rest = record["model"] or [""]
    return record["verb"], record["sample"], (first, *sorted(rest)) if record["model"] else ()


def _told(path: Path) -> tuple[str, str, tuple[str, ...]] | None:
    """Verb, sample and model of a record, or None where it is none of ours."""
    try:
        record = json.loads(path.read_text("utf-8"))
        if "made" in record:
            return _plain(record["made"])
        energy = record["energy"]
        energy = energy["name"] if isinstance(energy, dict) else energy
        if "verdict" in record:
            return "diagnosis", record["sample"], (energy,)
        return "fit", record["sample"], (energy, *sorted(effects_of(record)))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
