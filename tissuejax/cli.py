"""The command line: one parser over all sub-commands, errors as one sentence and an exit code.

0 done, 2 the input can't be used, 3 did not converge. With --json standard output carries one JSON object and nothing
else.
"""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from importlib import metadata

import jax

from tissuejax import commands as package
from tissuejax.commands.command import Command
from tissuejax.errors import TissueError
from tissuejax.families import members
from tissuejax.storage import plain

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


def parser() -> argparse.ArgumentParser:
    """The whole command line."""
    top = argparse.ArgumentParser(
        prog="tissuejax", description=TEACHES, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    try:
        version = metadata.version("tissuejax")
    except metadata.PackageNotFoundError:
        version = "not installed"
    top.add_argument("--version", action="version", version=f"tissuejax {version}")
    below = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, command in commands().items():
        sub = below.add_parser(
            name,
            help=command.summary,
            description=command.teaches.strip("\n"),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.arguments(sub)
        sub.add_argument("--json", action="store_true", help="answer with one JSON object on standard output")
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    jax.config.update("jax_enable_x64", True)
    given = parser().parse_args(argv)
    try:
        reply = commands()[given.command].run(given)
    except TissueError as error:
        if given.json:
            print(json.dumps({"status": "error", "error": str(error), "exit_code": error.exit_code}))
        print(f"tissuejax {given.command}: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print(f"tissuejax {given.command}: stopped", file=sys.stderr)
        return 130
    try:
        print(json.dumps(plain(reply.record), indent=2, ensure_ascii=False) if given.json else reply.text)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader (head, less) has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return reply.code


if __name__ == "__main__":
    sys.exit(main())
