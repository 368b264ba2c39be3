"""`tissuejax campaign`: one question asked of many samples."""

import argparse
import csv
import io
import math
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import ClassVar

from tissuejax import verbs
from tissuejax.campaign.run import begin, engines, fits, go_on, headline, status, table, units
from tissuejax.campaign.store import PLAN, Store
from tissuejax.campaign.task import Settings, first_of
from tissuejax.commands.arguments import add_fit, add_model, fit_options, positive
from tissuejax.commands.command import SUSPECT, Command, Reply
from tissuejax.commands.outputs import WITH_A_PAGE, listed
from tissuejax.errors import InputError
from tissuejax.fitting.options import Objective, Search
from tissuejax.progress import for_terminal
from tissuejax.storage import write_text

ACTIONS = ("run", "resume", "status", "report", "population")


class Campaign(Command):
    """Run, resume, look at and report a campaign."""

    name: ClassVar[str] = "campaign"
    order: ClassVar[int] = 45
    stopped: ClassVar[str] = (
        "what is finished is kept: the same command, or `tissuejax campaign resume FOLDER`, goes on with the rest"
    )
    summary: ClassVar[str] = "fit or diagnose thousands of samples, on one machine or a cluster; nothing is done twice"
    teaches: ClassVar[str] = """
Ask one question of every sample of many files. FOLDER holds the plan and one result file a case, under the hash of its
recordings, the settings and the code: what is there is not done again, a killed run goes on, a failure is a row.

  tissuejax campaign run out/ecoflex fits/ecoflex/ecoflex-each.toml --energy reduced-polynomial-2 --engine processes
  tissuejax campaign run out/beef day1.toml day2.toml --kind diagnose --energy neo-hookean --limit 600
  tissuejax campaign run cohort.yaml                              a problem file; FOLDER is then out/.../campaign
  tissuejax campaign status out/ecoflex
  tissuejax campaign resume out/ecoflex --engine dask --scheduler tcp://login:8786      --failed does failures again
  tissuejax campaign report out/ecoflex                                                 cases.csv and a page
  tissuejax campaign population out/ecoflex --group "^(EF\\d+)"                          mean, spreads, a new specimen

population takes the fits of a campaign together: typical values, the spread between specimens and between groups of
them (the part of a sample's name that --group matches: an animal, a day), and where a new specimen should lie. It needs
the extra `bayes`.

Engines: serial, processes, dask (extra `cluster`). docs/cohort.md shows Slurm.

A file that can't be read is a failed row too (said at the start, on standard error); mended, it is read again by `run`
or by `resume --failed`.

Exit code 0: some case gave numbers that can be used; 2: the input can't be used, no file can be read, or a pattern or a
FILE#NAME picks nothing; 4: cases ended and none gave usable numbers (failed, or suspect by the test of `fit`: at a
bound, unstable, a misfit of several times the noise; --json has "usable").
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """ACTION FOLDER [FILE ...] and settings, grouped by the actions they are for."""
        parser.add_argument("action", choices=ACTIONS, help=", ".join(ACTIONS))
        parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the campaign")
        parser.add_argument("files", nargs="*", metavar="FILE", help="for run: recording files or side files")
        asked = parser.add_argument_group("for run", "what is asked of every sample, as of `tissuejax fit`")
        asked.add_argument("--kind", default="fit", choices=["fit", "diagnose"], help="what is asked (default fit)")
        add_model(asked, required=False)
        add_fit(asked, multistart=2)
        asked.add_argument("--limit", type=float, default=0.0, metavar="S", help="seconds a case may take (0: any)")
        asked.add_argument("--retries", type=int, default=1, metavar="N", help="of a case that died (default 1)")
        asked.add_argument("--force", action="store_true", help="put another plan in the place of that in FOLDER")
        how = parser.add_argument_group("for run and resume", "how the cases are worked through")
        how.add_argument("--engine", default="serial", metavar="NAME", help=f"{', '.join(sorted(engines()))}")
        how.add_argument("--workers", type=int, default=2, metavar="N", help="at once (default 2)")
        how.add_argument("--scheduler", metavar="ADDRESS", help="of Dask, e.g. tcp://login:8786")
        how.add_argument("--failed", action="store_true", help="do failed cases again")
        among = parser.add_argument_group("for population")
        among.add_argument("--group", metavar="PATTERN", help="what of a sample's name is its group")
        parser.add_argument_group("for status and report", "FOLDER says it all; --json as everywhere")

    def run(self, given: argparse.Namespace) -> Reply:
        """One of the actions."""
        if given.action == "population":
            return _population(given.folder, given.group)
        if given.action == "run":
            if not given.files or given.energy is None:
                raise InputError("campaign run needs FILEs and --energy")
            if given.limit < 0 or given.retries < 0:
                raise InputError("--limit and --retries are 0 or more")
            settings = _settings(given)
            if not given.force:
                _refuse_another(given.folder, settings)
            _say_unread(begin(given.folder, given.files, settings, given.limit, given.retries), len(given.files))
        if given.action in ("run", "resume"):
            workers = positive(given.workers, "--workers")
            counts = go_on(given.folder, given.engine, workers, given.scheduler, given.failed, for_terminal())
            return Reply(
                counts,
                _text(counts)
                + f"\n{counts['ran']} done now in {counts['seconds']:.1f} s, {counts['per_second']:.2g} a second",
                _code(counts),
            )
        if given.action == "status":
            counts = status(given.folder)
            return Reply(counts, _text(counts))
        return _report(given.folder)


def _settings(given: argparse.Namespace) -> Settings:
    """What is asked of every sample; paths are checked on the first that can be read."""
    first = first_of(given.files)
    model = verbs.material(
        given.energy, ogden_form=given.ogden_form, volumetric=given.volumetric, effects=given.effect
    ).across(tuple(first.recordings))
    options = fit_options(given, model.parameters)
    search = options["search"]
    said = {"only": options["only"], "method": search.method, "max_steps": search.max_steps}
    said |= vars(options["unknowns"]) | vars(options["objective"])
    plain = vars(Search()) | vars(Objective())
    pairs = []
    for name, value in said.items():
        if value == plain.get(name) or value in (None, [], {}, (), False):
            continue
        if isinstance(value, dict):
            of = {path: v if isinstance(v, tuple) else (v,) for path, v in value.items()}
            value = tuple((path, *(x if math.isfinite(x) else str(x) for x in v)) for path, v in of.items())
        pairs.append((name, tuple(value) if isinstance(value, list) else value))
    return Settings(
        given.kind, given.energy, given.ogden_form, given.volumetric, tuple(given.effect), tuple(options["holdout"]),
        search.multistart, search.seed, tuple(pairs) if given.kind == "fit" else (),
    )  # fmt: skip


def _say_unread(store: Store, files: int) -> None:
    lost = [task for task in store.planned()[0] if task.unread]
    if lost:
        print(
            f"tissuejax campaign: {len({task.file for task in lost})} of {files} files can't be read, in whole or in "
            f"part; that is {len(lost)} failed row{'s' * (len(lost) != 1)}, and the others are worked through: "
            + ", ".join(task.sample for task in lost[:5])
            + (", ..." if len(lost) > 5 else ""),
            file=sys.stderr,
        )


def _refuse_another(folder: Path, settings: Settings) -> None:
    for name in (n for n in WITH_A_PAGE if n != PLAN):
        if (folder / name).is_file():
            raise InputError(f"{folder}: holds another result ({name}); name another folder, or give --force")
    if not (folder / PLAN).is_file():
        return
    there = {task.settings for task in Store(folder).planned()[0]}
    if there - {settings}:
        raise InputError(
            f"{folder}: holds a campaign with other settings; go on with it by `campaign resume`, name another folder, "
            "or give --force to plan anew (answers that are there stay)"
        )


def _text(counts: dict) -> str:
    lines = [headline(counts)]
    lines += [f"  ! {sample}: {reason}" for sample, reason in list(counts["failures"].items())[:20]]
    return "\n".join(lines)


def _code(counts: dict) -> int:
    """4 where cases ended and not one gave numbers that can be used; single suspect ones are a matter of the table."""
    return SUSPECT if counts["done"] + counts["failed"] and not counts["usable"] else 0


def _report(folder: Path) -> Reply:
    from tissuejax.report.cohort_page import write_cohort

    of = units(folder)
    named = {**of, **{f"std {path}": unit for path, unit in of.items()}}
    rows = [{f"{n} ({named[n]})" if n in named else n: v for n, v in row.items()} for row in table(folder)]
    columns = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns)
    writer.writeheader()
    writer.writerows(rows)
    files = {"table": write_text(folder / "cases.csv", text.getvalue())} | write_cohort(rows, status(folder), folder)
    counts = status(folder) | {"files": {n: str(p) for n, p in files.items()}}
    return Reply(counts, "\n".join([_text(counts), *listed(files)]), _code(counts))


def _population(folder: Path, pattern: str | None) -> Reply:
    from tissuejax.campaign.population import estimates, population
    from tissuejax.report.population_page import parameters, write_population

    specimens = fits(folder)
    if not specimens:
        raise InputError(f"{folder}: no finished fits (a population is one of fits, not of diagnoses)")
    found = population(estimates(specimens, None if pattern is None else _groups(specimens, pattern)))
    record = found.record()
    files = write_population(found, folder / "population")
    lines = [f"{record['specimens']} specimens" + (f" in {len(record['groups'])} groups" if record["groups"] else "")]
    lines[0] += f", {len(record['left_out'])} left out" if record["left_out"] else ""
    if record["suspect"]:
        first, why = next(iter(record["suspect"].items()))
        lines[0] += f"; {len(record['suspect'])} of them not to be used as they are (column suspect of specimens.csv)"
        lines.append(f"  ! {first}: {why}" + (", ..." if len(record["suspect"]) > 1 else ""))
    for row in parameters(found, record):
        unit = f" {row['unit']}" if row["unit"] else ""
        among = f", between groups {row['between_groups']}" if record["groups"] else ""
        lines += [
            f"  {row['path']}: typical {row['typical']}{unit}",
            f"    spread between specimens {row['between_specimens']}{among}",
            f"    a new specimen {row['new_specimen']}{unit}",
        ]
    lines += listed(files)
    code = SUSPECT if len(record["suspect"]) == record["specimens"] else 0
    return Reply(record | {"files": {n: str(p) for n, p in files.items()}}, "\n".join(lines), code)


def _groups(names: Iterable[str], pattern: str) -> dict[str, str]:
    try:
        rule = re.compile(pattern)
    except re.error as error:
        raise InputError(f"--group {pattern}: not a regular expression ({error})") from error
    found = {name: rule.search(name) for name in names}
    if lost := [name for name, hit in found.items() if hit is None]:
        raise InputError(f"--group {pattern}: matches nothing in {', '.join(lost[:3])}; it has to match every sample")
    return {name: hit.group(1) if rule.groups else hit.group(0) for name, hit in found.items()}
