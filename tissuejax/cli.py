"""The command line: one parser over all sub-commands, errors as one sentence and an exit code.

0 done, 2 the input can't be used, 3 did not converge, 4 a fit whose numbers should not be used as they are. With
--json standard output carries one JSON object and nothing else.
"""

import argparse
import ast
import importlib
import json
import os
import sys
import warnings
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from tissuejax import commands as package
from tissuejax.commands.command import Command
from tissuejax.commands.problem_file import expanded
from tissuejax.commands.sentences import Parser, sentence
from tissuejax.errors import InputError, TissueError
from tissuejax.families import members
from tissuejax.interrupt import CODE, said, stop, watched

TEACHES = """
tissuejax identifies the mechanics of soft tissue from recordings, by gradients through the model.

  tissuejax demo                                   see the whole thing on a recording that comes with the project
  tissuejax inspect FILE                           what is in a recording
  tissuejax fit FILE --energy NAME                 parameters, uncertainties, figures, one page
  tissuejax COMMAND --help                         each command explains itself, with examples
"""


def commands() -> dict[str, Command]:
    """All sub-commands by name, in the order of the help."""
    found = members(package, Command).values()
    return {kind.name: kind() for kind in sorted(found, key=lambda k: (k.order, k.name))}


class Listed(NamedTuple):
    """What the list of commands says of one, what Ctrl-C says of it, and the module it lives in."""

    name: str
    summary: str
    order: int
    stopped: str
    module: str


def listed() -> list[Listed]:
    """All sub-commands in the order of the help, read from the syntax of their files and not imported.

    A command brings JAX and the whole package along; the list of them should come at once. That is why name, summary,
    order and `stopped` of a command are literals.
    """
    found = []
    for path in sorted(Path(package.__path__[0]).glob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.ClassDef):
                continue
            told = {
                line.target.id: ast.literal_eval(line.value)
                for line in node.body
                if isinstance(line, ast.AnnAssign) and line.value is not None and line.target.id in Listed._fields
            }
            if "name" in told:
                plain = {"order": Command.order, "stopped": Command.stopped}
                found.append(Listed(**plain | told, module=f"{package.__name__}.{path.stem}"))
    return sorted(found, key=lambda c: (c.order, c.name))


def parser(only: str | None = None) -> argparse.ArgumentParser:
    """The whole command line, or the list of commands with the arguments of one.

    Args:
        only: the command whose arguments are wanted, None for all; of the others no module is imported.
    """
    top = Parser(prog="tissuejax", description=TEACHES, formatter_class=argparse.RawDescriptionHelpFormatter)
    top.add_argument("--version", action=Version, nargs=0, help="show the version and exit")
    entries = listed()
    top.asked = only if only in {entry.name for entry in entries} else ""
    below = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for entry in entries:
        summary = entry.summary.replace("%", "%%")  # argparse fills in what follows a single one
        if only is not None and entry.name != only:
            below.add_parser(entry.name, help=summary)
            continue
        command = _command(entry)
        sub = below.add_parser(
            entry.name,
            help=summary,
            description=command.teaches.strip("\n"),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.arguments(sub)
        sub.add_argument("--json", action="store_true", help="answer with one JSON object on standard output")
    return top


class Version(argparse.Action):
    """Prints the installed version; looked up when asked for."""

    def __call__(self, parser, namespace, values, option_string=None):
        try:
            version = metadata.version("tissuejax")
        except metadata.PackageNotFoundError:
            version = "not installed"
        print(f"tissuejax {version}")
        parser.exit()


def _command(entry: Listed) -> Command:
    module = importlib.import_module(entry.module)
    return next(
        member()
        for member in vars(module).values()
        if isinstance(member, type) and issubclass(member, Command) and getattr(member, "name", None) == entry.name
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code (where Ctrl-C ends it in a process of its own, that ends at once)."""
    own, argv = argv is None, list(sys.argv[1:] if argv is None else argv)
    known = {entry.name: entry for entry in listed()}
    name = next((word for word in argv if not word.startswith("-")), "")
    more = known[name].stopped if name in known else ""
    if own:
        warnings.showwarning = _warned
        watched(name, more)
    try:
        argv = expanded(argv)
        given = parser(name).parse_args(argv)

        import jax  # after the parser, so that help and a mistyped option answer at once

        jax.config.update("jax_enable_x64", True)
        reply = _command(known[given.command]).run(given)
    except TissueError as error:
        return _refused(name, error, "--json" in argv)
    except OSError as error:
        if isinstance(error, ConnectionError):  # a pipe to a worker of ours: a fault, not the user's
            raise
        return _refused(name, InputError(sentence(error)), "--json" in argv)
    except KeyboardInterrupt:
        if own:
            stop(name, more)
        print(said(name, more), file=sys.stderr)
        return CODE
    from tissuejax.storage import plain

    try:
        print(json.dumps(plain(reply.record), indent=2, ensure_ascii=False) if given.json else reply.text)
        sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):  # the reader (head, less) has seen enough
            return _refused(name, InputError(f"standard output: {sentence(error)}"), False)
    return reply.code


def _warned(message, category, filename, lineno, file=None, line=None) -> None:
    """What the package warns of as one line; what its libraries tell their own callers is no user's business."""
    if issubclass(category, UserWarning):
        print(f"tissuejax: {message}", file=sys.stderr)


def _refused(name: str, error: TissueError, as_json: bool) -> int:
    from tissuejax.storage import printable

    said = printable(str(error))  # one sentence in one line, whatever a file is called
    if as_json:
        print(json.dumps({"status": "error", "error": said, "exit_code": error.exit_code}))
    print(f"tissuejax {name}".strip() + f": {said}", file=sys.stderr)
    return error.exit_code


if __name__ == "__main__":
    sys.exit(main())
