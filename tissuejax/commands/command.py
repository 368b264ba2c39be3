"""What every sub-command is: a name, help that teaches, its arguments, and one function from arguments to a reply."""

import abc
import argparse
from dataclasses import dataclass
from typing import ClassVar

SUSPECT = 4  # exit code of numbers that should not be used as they are


@dataclass(frozen=True)
class Reply:
    """What a command answers.

    Attributes:
        record: for `--json`.
        text: for people.
        code: exit code, 0 done, 3 did not converge, 4 done but not to be used as it is (2, bad input, is raised as
            InputError).
    """

    record: dict
    text: str
    code: int = 0


class Command(abc.ABC):
    """One sub-command. A new one is a new file in this folder.

    Class data:
        name: as typed after `tissuejax`.
        summary: one line for the list of commands.
        teaches: what it does, when to use it, with examples; shown by `tissuejax NAME --help`.
        order: place in the list.
        stopped: what Ctrl-C says beside "stopped", where a command can go on.

    Name, summary, order and stopped are literals: the list of commands is read from the files without importing them.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    teaches: ClassVar[str]
    order: ClassVar[int] = 100
    stopped: ClassVar[str] = ""

    @abc.abstractmethod
    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the arguments (`--json` is there already)."""

    @abc.abstractmethod
    def run(self, given: argparse.Namespace) -> Reply:
        """Do it.

        Raises:
            InputError: what came can't be used; exit code 2.
            NotConverged: no answer; exit code 3.
        """
