"""The family of recording formats: one file a format, found by walking this folder."""

import abc
from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.recording import Sample


class Format(abc.ABC):
    """One way in which recordings lie on disk.

    Attributes:
        name: what messages call it.
        endings: file name endings that announce it, for messages and for choosing where the content doesn't tell.
    """

    name: ClassVar[str]
    endings: ClassVar[tuple[str, ...]]

    @abc.abstractmethod
    def recognises(self, path: Path, head: bytes) -> bool:
        """Whether a file with these first bytes (up to 4096) is of this format; cheap and without errors."""

    @abc.abstractmethod
    def names(self, path: Path) -> list[str]:
        """The names of the samples in the file, in file order."""

    @abc.abstractmethod
    def read(self, path: Path, name: str) -> Sample:
        """The sample called `name`, checked.

        Raises:
            InputError: file, place in the file, what was found, what was expected.
        """
