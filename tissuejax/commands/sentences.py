"""What argparse and the operating system complain of, as one sentence of ours that names the option or the file."""

import argparse
import difflib
import errno
import re
from typing import NoReturn

from tissuejax.errors import InputError

_WANTED = {"int": "a whole number", "float": "a number", "Path": "a path"}
_FULL = (errno.ENOSPC, errno.EDQUOT)


class Parser(argparse.ArgumentParser):
    """An argument parser that refuses by raising InputError: one sentence, no block of usage.

    Attributes:
        asked: the command that was called, where this parser is the one of all commands.
    """

    asked = ""

    def error(self, message: str) -> NoReturn:
        """The sentence for what argparse found.

        Raises:
            InputError: always.
        """
        called = f"{self.prog} {self.asked}".strip()
        raise InputError(f"{self._plain(message)}; `{called} --help` explains it")

    def _plain(self, message: str) -> str:
        found = re.fullmatch(r"argument (.+?): invalid (\w+) value: (.*)", message, re.S)
        if found:
            wanted = _WANTED.get(found[2], found[2])
            return f"{_option(found[1])}: found {found[3]}, expected {wanted}"
        found = re.fullmatch(r"argument (.+?): invalid choice: (.*?) \(choose from (.*)\)", message, re.S)
        if found:
            known = [k.strip().strip("'") for k in found[3].split(",")]
            return f"{_option(found[1])}: found {found[2]}{_nearest(found[2].strip(chr(39)), known)}"
        found = re.fullmatch(r"argument (.+?): (.*)", message, re.S)
        if found:
            return f"{_option(found[1])}: {found[2]}"
        found = re.fullmatch(r"unrecognized arguments: (.*)", message, re.S)
        if found:
            first = found[1].split()[0]
            return f"found {found[1]}, which it doesn't know{_nearest(first, self._known())}"
        found = re.fullmatch(r"the following arguments are required: (.*)", message, re.S)
        if found:
            return f"found no {' and no '.join(_option(n) for n in found[1].split(', '))}, which it needs"
        return message

    def _known(self) -> list[str]:
        own = [option for action in self._actions for option in action.option_strings]
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                own += [o for sub in action.choices.values() for a in sub._actions for o in a.option_strings]
        return sorted(set(own))


def _option(name: str) -> str:
    """ "--out/-o" as "--out"."""
    return next((n for n in name.split("/") if n.startswith("--")), name)


def _nearest(word: str, known: list[str]) -> str:
    close = difflib.get_close_matches(word, known, n=2, cutoff=0.5)
    return f"; did you mean {' or '.join(close)}?" if close else f"; known are {', '.join(known)}"


def sentence(error: OSError) -> str:
    """What the operating system refused, which file it was about, and what to do."""
    place = f"{error.filename}: " if error.filename else ""
    if error.errno in _FULL or "No space left" in str(error):
        return (
            f"{place}the disk is full: nothing more can be written there; make room or name another folder with --out"
        )
    if error.errno == errno.ENAMETOOLONG:
        return f"{place[:80]}...: the name is too long for a file; give a shorter one"
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"{place}no permission to read or write it; change its rights or name another"
    if error.errno in (errno.ENOENT, errno.EISDIR, errno.ENOTDIR, errno.EROFS):
        return f"{place}{error.strerror}; name another file or folder"
    return f"{place}can't be read or written ({error.strerror or error})"
