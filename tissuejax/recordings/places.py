"""Where a side file's data lie: beside the side file, or in the shared folder of recordings ("shared:...")."""

import errno
import os
from pathlib import Path

from tissuejax.errors import InputError
from tissuejax.storage import shown

PREFIX = "shared:"
VARIABLE = "TISSUEJAX_SHARED"


def resolve(text: str, side: Path) -> Path:
    """The file that `text` names in the side file `side`.

    A plain path is relative to the side file. "shared:recordings/x.csv" lies in the folder that the environment
    variable TISSUEJAX_SHARED names or, where that isn't set, in a folder `shared` beside any folder above the side
    file (beside the checkout, as a rule).

    Raises:
        InputError: no such file; the message says what to set.
    """
    if not text.startswith(PREFIX):
        path = side.parent / text
        if not path.is_file():
            raise InputError(f"{side}: file = {text!r}: no such file {path}; paths are relative to the side file")
        return path
    rest = text.removeprefix(PREFIX)
    folders = [Path(os.environ[VARIABLE])] if os.environ.get(VARIABLE) else _beside(side.resolve())
    for folder in folders:
        if (folder / rest).is_file():
            return folder / rest
    where = f"{VARIABLE} is {folders[0]}" if os.environ.get(VARIABLE) else f"{VARIABLE} is not set"
    raise InputError(
        f"{side}: file = {text!r}: not found; {where}. Set {VARIABLE} to the folder that holds {Path(rest).parts[0]}/, "
        "or put that folder beside the checkout under the name 'shared'"
    )


def refuse_no_file(path: Path, expected: str) -> None:
    """Refuse what isn't a file that can be read.

    Args:
        path: as the user gave it.
        expected: what it should be.

    Raises:
        InputError: no such file (those that are there are named), a link without its target, a name too long, a
            folder, a pipe or a device.
    """
    try:
        there = path.exists()
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:
            raise
        raise InputError(f"{shown(path)}: the name is too long for a file; give a shorter one") from error
    if not there and path.is_symlink():
        raise InputError(
            f"{path}: is a link to {os.readlink(path)}, where there is no file: mend the link, or name the file itself"
        )
    if not there:
        beside = path.parent.glob(f"[!.]*{path.suffix}") if path.parent.is_dir() else ()
        near = sorted(p.name for p in beside if p.exists())[:8]
        others = f" In {path.parent} there are: {', '.join(near)}." if near else ""
        raise InputError(f"{path}: no such file.{others}")
    if path.is_dir():
        raise InputError(f"{path}: found a folder, expected a file: {expected}")
    if not path.is_file():
        raise InputError(f"{path}: found a pipe or a device, expected a file: {expected}")


def _beside(side: Path) -> list[Path]:
    return [parent / "shared" for parent in side.parents]
