"""Score a room's tests on mutants drawn at random: how many of N changed lines does some test notice?

    python tests/mutation/sample.py ROOM [N] [SEED]         ROOM: a file of this folder; N: 24, SEED: 0 by default

A room's file names modules and, for each, the tests that say whether its numbers are right, the quickest first; what
survives those meets the room's `wider` tests, if it has any. Mutants are
those of cosmic-ray, of the last commit, in a copy of it that is removed afterwards. Left out are those that can't
change a number or that any import would notice: annotations, the text of errors, bit operations on numbers, orders of
what is compared by identity, decorators.

No store of programs can hide a mutant: the project's own is switched off, and JAX's (a fresh folder, which the tests of
the unchanged code fill) goes by the content of each program, which is compiled with little effort. Prints every
survivor as a patch, how many ended by running out of time, and the share killed with its 95 % interval (Wilson).
"""

import ast
import os
import random
import resource
import shlex
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

from cosmic_ray.commands import init
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import TestOutcome

HERE = Path(__file__).parent
ARITHMETIC = {"Add", "Sub", "Mul", "Div", "FloorDiv", "Mod", "Pow"}
BITS = {"RShift", "LShift", "BitOr", "BitAnd", "BitXor"}
ORDER = {"Eq", "NotEq", "Lt", "LtE", "Gt", "GtE"}
IDENTITY = {"Is", "IsNot"}
PATIENCE = 10  # times what the unchanged code takes, after which a mutant is taken for an endless loop


def speaks(operator: str) -> bool:
    """Whether a replacement can give another number without breaking every import."""
    kind, *names = operator.removeprefix("core/").split("_")
    if kind in ("ReplaceBinaryOperator", "ReplaceComparisonOperator"):
        return any(set(names) <= family for family in (ARITHMETIC, BITS, ORDER, IDENTITY))
    return kind != "RemoveDecorator" and "Invert" not in names


def silent(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Begin and end (line, column) of what carries no number: annotations and what is raised."""
    found = []
    for node in ast.walk(ast.parse(source)):
        parts = [getattr(node, "annotation", None), getattr(node, "returns", None)]
        if isinstance(node, ast.Raise):
            parts.append(node)
        found += [
            ((p.lineno, p.col_offset), (p.end_lineno or 0, p.end_col_offset or 0)) for p in parts if p is not None
        ]
    return found


def mutants(modules: list[Path], folder: Path) -> list:
    """All that may be drawn, in an order that depends on the code alone."""
    with use_db(str(folder / "session.sqlite"), WorkDB.Mode.create) as db:
        init(modules, db, {})
        items = list(db.work_items)
    quiet = {str(m): silent(m.read_text()) for m in modules}

    def counts(item) -> bool:
        (m,) = item.mutations
        inside = any(a <= tuple(m.start_pos) < b for a, b in quiet[str(m.module_path)])
        return speaks(m.operator_name) and not inside

    return sorted((i for i in items if counts(i)), key=lambda i: str(i.mutations))


def interval(k: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    z, share = 1.96, k / n
    centre = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * (share * (1 - share) / n + z**2 / (4 * n**2)) ** 0.5
    return centre - half, centre + half


class Runner:
    """Runs tests on mutants, with a patience that goes by what the unchanged code takes."""

    def __init__(self):
        self.took: dict[str, float] = {}

    def __call__(self, item, tests: str):
        """The result of some tests on a mutant."""
        command = f"{sys.executable} -m pytest -x -q -p no:cacheprovider {tests}"
        if command not in self.took:
            begun = time.perf_counter()
            subprocess.run(shlex.split(command), check=True, stdout=subprocess.DEVNULL)
            self.took[command] = time.perf_counter() - begun
            print(f"unchanged{self.took[command]:6.1f} s  {tests}", flush=True)
        return mutate_and_test(item.mutations, command, max(120.0, PATIENCE * self.took[command]))


def score(tests: dict[str, str], wider: str, n: int, seed: int, folder: Path) -> str:
    """Draw, run, count; in the working directory, which is a copy."""
    items = mutants([Path(m) for m in tests], folder)
    drawn = random.Random(seed).sample(items, min(n, len(items)))
    run, survived, timeouts = Runner(), [], 0
    for item in drawn:
        (m,) = item.mutations
        result = run(item, tests[str(m.module_path)])
        if wider and result.test_outcome == TestOutcome.SURVIVED:
            result = run(item, wider)
        outcome = "timeout" if result.output == "timeout" else str(result.test_outcome.value)
        where = f"{m.module_path}:{m.start_pos[0]} {m.operator_name.removeprefix('core/')}"
        print(f"{outcome:<9} {where}", flush=True)
        timeouts += outcome == "timeout"
        if result.test_outcome == TestOutcome.SURVIVED:
            survived.append(result.diff)
            print(result.diff, flush=True)
    k, total = len(drawn) - len(survived), len(drawn)
    low, high = interval(k, total)
    late = f", {timeouts} of them by running out of time" if timeouts else ""
    return f"{k} of {total} drawn of {len(items)} killed{late}, {k / total:.0%} ({low:.0%} to {high:.0%})"


def main(room: str, n: int = 24, seed: int = 0) -> str:
    """Score a room in a copy of the last commit."""
    said = tomllib.loads((HERE / f"{room}.toml").read_text())
    tests, wider = said["modules"], said.get("wider", "")
    with tempfile.TemporaryDirectory() as name:
        folder, copy = Path(name), Path(name) / "copy"
        subprocess.run(["git", "-C", HERE, "worktree", "add", "-q", "--detach", copy, "HEAD"], check=True)
        try:
            os.chdir(copy)
            os.environ |= {"PYTHONPATH": str(copy), "TISSUEJAX_CACHE": "off", "PYTHONDONTWRITEBYTECODE": "1",
                           "XLA_FLAGS": "--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true",
                           "JAX_COMPILATION_CACHE_DIR": str(folder / "programs"),
                           "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}  # fmt: skip
            told = score(tests, wider, n, seed, folder)
            commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout
        finally:
            os.chdir(HERE)
            subprocess.run(["git", "-C", HERE, "worktree", "remove", "--force", copy], check=True)
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return f"{room} at {commit.strip()}: {told}, {spent.ru_utime + spent.ru_stime:.0f} s of CPU time"


if __name__ == "__main__":
    print(main(sys.argv[1], *map(int, sys.argv[2:])))
