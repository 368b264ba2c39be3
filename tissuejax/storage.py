"""Files written whole or not at all.

Every writer works on a temporary file in the same folder and renames it into place (`os.replace` is atomic within a
file system), so that a reader, a second run or an interruption never meets half a result.
"""

import errno
import json
import math
import os
import re
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np

from tissuejax.errors import InputError


@contextmanager
def replacing(path: str | os.PathLike) -> Iterator[Path]:
    """A temporary path beside `path`; it becomes `path` when the block ends, and is removed if the block fails.

    The ending is kept, because several libraries choose the format by it. Missing folders are made.

    Raises:
        InputError: the folder can't be made or written.
    """
    path = Path(path)
    # Only the ending is kept: a long name must not get longer.
    temporary = path.with_name(f".{secrets.token_hex(6)}{''.join(path.suffixes[-2:])[-12:]}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield temporary
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        if isinstance(error, ConnectionError):
            raise
        raise InputError(f"{shown(path)}: can't be written ({_why(error)})") from error


def shown(path: str | os.PathLike) -> str:
    """A path for a message: a line break in a name as \\n, and a name too long for a file too long for a sentence."""
    text = printable(os.fspath(path))
    return text if len(text) <= 200 else f"{text[:100]}...{text[-40:]}"


def printable(text: str) -> str:
    """A text in one line: line breaks and control characters as Python writes them."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def _why(error: OSError) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT) or "No space left" in str(error):
        return "the disk is full; make room or name an output folder on another disk"
    if error.errno == errno.ENAMETOOLONG:
        return "its name is too long; give a shorter name"
    inner = re.search(r"error message = '([^']*)'", str(error))  # as HDF5 tells it
    return f"{error.strerror or (inner[1] if inner else error)}; name another output file or folder"


def write_bytes(path: str | os.PathLike, content: bytes) -> Path:
    """Write `content` atomically; returns the path."""
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    return Path(path)


def write_text(path: str | os.PathLike, content: str) -> Path:
    """Write `content` as UTF-8 atomically; returns the path."""
    return write_bytes(path, content.encode("utf-8"))


def write_between(path: str | os.PathLike, begin: str, end: str, content: str) -> Path:
    """Replace what stands between two marks of a text, each on a line of its own, atomically; returns the path.

    Raises:
        InputError: a mark that is not there once, or the end before the beginning.
    """
    text = Path(path).read_text(encoding="utf-8")
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(end)
    if text.count(begin) != 1 or text.count(end) != 1 or end not in rest:
        raise InputError(f"{path}: nothing to fill in; it needs the lines {begin} and {end}, once and in this order")
    return write_text(path, f"{before}{begin}\n{content.strip()}\n{end}{after}")


def write_json(path: str | os.PathLike, content: object) -> Path:
    """Write `content` as indented JSON atomically; arrays become lists, NaN and infinities become null."""
    return write_text(path, json.dumps(plain(content), indent=2, allow_nan=False, ensure_ascii=False) + "\n")


def write_npz(path: str | os.PathLike, arrays: Mapping[str, np.ndarray]) -> Path:
    """Write named arrays as a compressed npz atomically; returns the path (ending .npz)."""
    path = Path(path) if str(path).endswith(".npz") else Path(f"{path}.npz")
    with replacing(path) as temporary:
        np.savez_compressed(temporary, **cast(Any, {name: np.asarray(array) for name, array in arrays.items()}))
    return path


def write_figure(path: str | os.PathLike, figure: Any, **options: Any) -> Path:
    """Save a figure (anything with `savefig`) atomically, in the format its ending names; `options` go to it."""
    with replacing(path) as temporary:
        figure.savefig(temporary, **options)
    return Path(path)


def plain(content: object) -> object:
    """`content` in the types JSON knows: numpy and JAX arrays as lists, paths as text, non-finite numbers as None.

    Raises:
        TypeError: an object with no such form.
    """
    if content is None or isinstance(content, str | bool | int):
        return content
    if isinstance(content, float):
        return content if math.isfinite(content) else None
    if isinstance(content, Mapping):
        return {str(key): plain(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [plain(value) for value in content]
    if isinstance(content, set | frozenset):
        return [plain(value) for value in sorted(content)]
    if isinstance(content, os.PathLike):
        return os.fspath(content)
    if hasattr(content, "__array__"):
        return plain(np.asarray(content).tolist())
    raise TypeError(f"{type(content).__name__} has no JSON form: {content!r}")
