"""Where results go: a folder for each verb, sample and model; nothing is overwritten that is something else."""

import json
from collections.abc import Sequence
from pathlib import Path

from tissuejax.errors import InputError


def folder(
    out: Path | None, verb: str, sample: str, energy: str, effects: Sequence[str] = (), force: bool = False
) -> Path:
    """The folder to write into: `out`, or out/SAMPLE-VERB-ENERGY by default.

    The same command may be given again. A finished result of another verb, sample or model is not overwritten.

    Args:
        out: as the user said, or None.
        verb: "fit" or "diagnosis".
        sample, energy, effects: what is computed.
        force: overwrite whatever is there.

    Raises:
        InputError: the folder holds another result; says which, and what to do.
    """
    place = out or Path("out") / "-".join([sample, verb, energy, *effects])
    found = place / "result.json"
    if force or not found.is_file():
        return place
    there, mine = _told(found), (verb, sample, energy, tuple(sorted(effects)) if verb == "fit" else ())
    if there != mine:
        what = "a result of another kind" if there is None else f"the {there[0]} of {there[1]} with {there[2]}"
        raise InputError(f"{place}: holds {what}; name another folder with --out, or give --force to overwrite it")
    return place


def _told(path: Path) -> tuple[str, str, str, tuple[str, ...]] | None:
    """Verb, sample, energy and effects of a result.json, or None where it is none of ours."""
    try:
        record = json.loads(path.read_text("utf-8"))
        energy = record["energy"]
        energy = energy["name"] if isinstance(energy, dict) else energy
        verb = "diagnosis" if "verdict" in record else "fit"
        return verb, record["sample"], energy, tuple(sorted(record["effects"])) if verb == "fit" else ()
    except (OSError, ValueError, KeyError, TypeError):
        return None
