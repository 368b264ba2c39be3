"""Which code this process runs: one hash of the package's source, taken before any other part of it is loaded.

Python loads modules one by one, and files may be edited meanwhile (a notebook, an editor, an update). What is kept on
disk must carry the formulas that made it, not those that lie in the files later. So the hash is taken once, when the
package is imported, and it counts only for modules that were loaded before any file moved: once another one is loaded
later, `content` is None, and nothing is kept or found any more by this process.
"""

import hashlib
import os
import sys
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

Marks = Mapping[str, tuple[int, int, int]]


def files(root: Path = ROOT) -> list[Path]:
    """All files of the package that may act in a computation, sorted."""
    found = []
    for folder, below, names in os.walk(root):
        below[:] = sorted(name for name in below if name != "__pycache__")
        found += [Path(folder, name) for name in sorted(names) if not name.endswith((".pyc", ".pyo"))]
    return found


def marks(root: Path = ROOT) -> Marks:
    """Time of the last write, time of the last change and size of every file, ns, ns, bytes.

    The time of change can't be set back, so a file that was edited and restored has moved too.
    """
    found = {}
    for path in files(root):
        seen = path.stat()
        found[str(path.relative_to(root))] = seen.st_mtime_ns, seen.st_ctime_ns, seen.st_size
    return found


def hashed(root: Path = ROOT) -> str:
    """SHA-256 of the names and contents of all files."""
    found = hashlib.sha256()
    for path in files(root):
        content = path.read_bytes()
        found.update(f"{path.relative_to(root).as_posix()}\n{len(content)}\n".encode() + content)
    return found.hexdigest()


def ambiguous() -> list[str]:
    """Loaded modules whose compiled file Python may have taken although the source was newer.

    Python tells the two apart by the second and the size; an edit of equal size in the second in which the compiled
    file was written is not seen.
    """
    found = []
    for name, module in list(sys.modules.items()):
        if not _ours(name) or not getattr(module, "__cached__", None):
            continue
        try:
            source, compiled = os.stat(module.__file__), os.stat(module.__cached__)
        except (OSError, TypeError):
            continue
        same = int(source.st_mtime) == int(compiled.st_mtime)
        if same and compiled.st_mtime_ns < source.st_mtime_ns:
            found.append(name)
    return found


_verified: dict[str, object] = {}  # modules that were loaded while no file had moved, with their specs
_AT_IMPORT = marks()  # before the contents are read: an edit between the two is seen as one
LOADED = hashed()


def moved() -> list[str]:
    """Files that were written, added or removed since the package was imported."""
    try:
        now = marks()
    except OSError:  # removed while they were listed
        return ["a file was removed"]
    changed = {name for name in {*now, *_AT_IMPORT} if now.get(name) != _AT_IMPORT.get(name)}
    return sorted(changed) or ambiguous()


def content() -> str | None:
    """The hash of the code that this process runs; None where a part was loaded after its file had moved.

    What is loaded stays as it is, whatever happens to its file. So files are looked at again only when modules were
    loaded (or loaded anew) since the last look.
    """
    now = {name: getattr(m, "__spec__", None) for name, m in list(sys.modules.items()) if _ours(name)}
    if not (now.keys() == _verified.keys() and all(now[name] is _verified[name] for name in now)):
        if moved():
            return None
        _verified.clear()
        _verified.update(now)
    return LOADED


def _ours(name: str) -> bool:
    return name.partition(".")[0] == "tissuejax"
