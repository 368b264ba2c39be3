"""Where a side file's data lie: beside the side file, or in the shared folder of recordings ("shared:...")."""

import os
from pathlib import Path

from tissuejax.errors import InputError

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


def _beside(side: Path) -> list[Path]:
    return [parent / "shared" for parent in side.parents]
