"""One store of finished runs, in memory and, where a folder is named, on disk.

A fit and a diagnosis ask for the same simulation more than once (a start, a step that is taken back, a set of effects
tried in another order), and a diagnosis that was stopped asks for all of them again.
"""

from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from tissuejax.cache.key import key as key_of
from tissuejax.storage import replacing

Run = TypeVar("Run")


@dataclass
class Finished(Generic[Run]):
    """Runs by what was asked for.

    Attributes:
        folder: where runs, arrays then, are kept as `.npy`; None keeps them in memory only.
        depends: all that a run depends on beside its key (`cache.key.described`); None where that can't be told, and
            nothing is kept on disk.
    """

    folder: Path | None = None
    depends: str | None = None
    _known: dict[Hashable, Run] = field(default_factory=dict)

    def __getitem__(self, key: Hashable) -> Run:
        return self._known[key]

    def __contains__(self, key: Hashable) -> bool:
        return key in self._known

    def __len__(self) -> int:
        return len(self._known)

    def unknown(self, keys: Iterable[Hashable]) -> list[Hashable]:
        """Those of `keys` that are not in memory, each once, in order."""
        return [k for k in dict.fromkeys(keys) if k not in self._known]

    def missing(self, keys: Iterable[Hashable]) -> list[Hashable]:
        """Those of `keys` that have to be run, each once, in order; what is on disk is read."""
        return [k for k in self.unknown(keys) if not self._read(k)]

    def keep(self, key: Hashable, run: Run) -> None:
        """Remember a finished run."""
        self._known[key] = run
        path = self._path(key)
        if path is not None:
            with replacing(path) as temporary, open(temporary, "wb") as file:
                np.save(file, np.asarray(run))

    def forget(self) -> None:
        """What asked for the runs is finished: remove what was kept on disk."""
        if self.folder is not None and self.folder.exists():
            for path in self.folder.glob("*.npy"):
                path.unlink(missing_ok=True)
            if not any(self.folder.iterdir()):
                self.folder.rmdir()

    def _path(self, key: Hashable) -> Path | None:
        if self.folder is None or self.depends is None:
            return None
        name = key_of(self.depends, key)  # None where the code has moved since it was loaded
        return None if name is None else self.folder / f"{name}.npy"

    def _read(self, key: Hashable) -> bool:
        path = self._path(key)
        if path is not None and path.exists():
            self._known[key] = np.load(path)
        return key in self._known
