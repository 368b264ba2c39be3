"""Parts of a study in one file, each with the code that made it: a part of other code is worked out again.

What a part needs is the package as loaded (`source`) and the study's own files, which the package doesn't load. Both
are read before the study begins; a part during which one of them moved is stored, but known by no code.
"""

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from tissuejax.cache import source
from tissuejax.storage import plain, write_json

MADE_BY = "made by"  # key of the file beside the parts: {part: {"code": hash} or {"earlier": commit}}
ONLY = "PARTS"  # environment: beginnings of the names to look at, separated by semicolons


class Parts:
    """`result.json` of a study as it grows.

    A part stored before codes were kept is known by `{"earlier": COMMIT}`, the commit that put these numbers into the
    file; it counts as made by other code.
    """

    def __init__(self, path: Path, files: Iterable[Path] = ()):
        """`files`: all that parts may need beside the package; to be named before any of them is run."""
        self.path = path
        self.parts: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
        self.made_by: dict[str, dict] = self.parts.pop(MADE_BY, {})
        self.run: dict[str, str] = {}  # parts worked out by this process, and why
        self.left: list[str] = []  # parts of other code that were not asked for
        self._files = {file: _content(file) for file in files}
        wanted = os.environ.get(ONLY)
        self._wanted = None if wanted is None else tuple(w.strip() for w in wanted.split(";"))

    def get(self, name: str, work: Callable[[], Any], needs: Iterable[Path] | None = None, of: object = None) -> Any:
        """The part of that name: as stored if the same code made it, else by `work()`.

        Args:
            needs: those of the study's files that it depends on; all of them if not said.
            of: numbers that it is made of (another part), if any.
        """
        needs = tuple(self._files if needs is None else needs)
        code = self._code(needs, of)
        if name in self.parts:
            made_by = self.made_by.get(name, {})
            if code is not None and made_by.get("code") == code:
                return self.parts[name]
            if self._wanted is not None and not name.startswith(self._wanted):
                self.left.append(name)
                return self.parts[name]
            earlier = "earlier" in made_by
            self.run[name] = f"stored at {made_by['earlier']}, by earlier code" if earlier else "its code had changed"
        else:
            self.run[name] = "not there before"
        found = plain(work())  # as the file will have it
        same = code is not None and code == self._code(needs, of, {file: _content(file) for file in needs})
        self.parts[name], self.made_by[name] = found, {"code": code if same else None}
        write_json(self.path, self.parts | {MADE_BY: self.made_by})
        return found

    def said(self) -> str:
        """What was worked out, why, and what is of other code still, for the study's answer; "" if all was kept."""
        why: dict[str, list[str]] = {}
        for name, reason in self.run.items():
            why.setdefault(reason, []).append(name)
        lines = [f"worked out ({reason}): {'; '.join(names)}" for reason, names in why.items()]
        lines += [f"left as other code made them: {'; '.join(self.left)}"] if self.left else []
        return ". ".join(lines)

    def _code(self, needs: tuple[Path, ...], of: object, contents: Mapping[Path, str] | None = None) -> str | None:
        """Hash of the code; None where the package moved while it was being loaded."""
        package = source.content()
        if package is None:
            return None
        contents = self._files if contents is None else contents
        files = sorted((file.name, contents[file]) for file in needs)
        return hashlib.sha256(json.dumps([package, files, plain(of)]).encode()).hexdigest()


def _content(file: Path) -> str:
    """Hash of a file's content; nothing where there is no such file."""
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""
