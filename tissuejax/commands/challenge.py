"""`tissuejax challenge`: make sealed cases, run the diagnosis over them, open the keys and grade."""

import argparse
from collections import Counter
from pathlib import Path
from typing import ClassVar

from tissuejax.challenge.compare import compare
from tissuejax.challenge.grade import grade
from tissuejax.challenge.make import KINDS, make
from tissuejax.challenge.run import run
from tissuejax.commands.arguments import positive, seed
from tissuejax.commands.command import Command, Reply
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.numbers import Numbers
from tissuejax.diagnosis.judgement.rejudge import JUDGED, rejudge
from tissuejax.errors import InputError
from tissuejax.progress import for_terminal
from tissuejax.report.challenge_table import figures


class ChallengeCommand(Command):
    """Make, run and grade a challenge of the diagnosis."""

    name: ClassVar[str] = "challenge"
    order: ClassVar[int] = 80
    summary: ClassVar[str] = "measure the diagnosis on sealed cases from a simulator of its own"
    teaches: ClassVar[str] = """
Measure the diagnosis like a medical test. `make` draws cases from a seed (material tests from closed forms, probing by
an implicit finite-element solver; neither shares code with the diagnosis), writes the recordings, seals the truth in a
file of its own and keeps that file's hash. `run` diagnoses case by case and goes on where it was interrupted. `grade`
checks the hash, opens the truth and writes graded.csv, confusion.csv, by_size.csv, graded.json and figures. `rivals`
says what simpler ways of answering would have said on the same cases. `judge` asks the stored evidence of every case
that was run for its verdict again, in milliseconds a case, and rewrites it: for when the rules of the judgement have
changed. With --number it says what one other number would make of it, and writes nothing.

  tissuejax challenge make out/challenge --kind material --count 210 --seed 7
  tissuejax challenge run out/challenge --jobs 2
  tissuejax challenge judge out/challenge
  tissuejax challenge judge out/challenge --number criteria.coarse=100
  tissuejax challenge grade out/challenge --out fits/challenge/material
  tissuejax challenge rivals out/challenge --out fits/challenge/material
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """What to do, the challenge's folder, and the options of each."""
        parser.add_argument(
            "action",
            choices=("make", "run", "judge", "grade", "rivals"),
            help="draw sealed cases; diagnose them; judge their evidence again; open the keys; simpler ways",
        )
        parser.add_argument("folder", type=Path, metavar="FOLDER", help="the challenge")
        parser.add_argument(
            "--kind",
            choices=KINDS,
            default="material",
            help="make: material tests (default), probing, rest, or cutting",
        )
        parser.add_argument("--count", type=int, default=200, metavar="N", help="make: number of cases (default 200)")
        parser.add_argument("--seed", type=seed, default=1, help="make: the same seed gives the same cases (default 1)")
        parser.add_argument(
            "--commit", metavar="HASH", help="make: draw the seed from this commit's hash, so that nobody chooses it"
        )
        parser.add_argument(
            "--strong",
            action="store_true",
            help="make: probings with one or two strong effects, no nulls, no strangers",
        )
        parser.add_argument(
            "--pairs", action="store_true", help="make: probings with two effects each, strong ones that can be seen"
        )
        parser.add_argument(
            "--rest", action="store_true", help="make: probings with a rest in the force that no catalogue has"
        )
        parser.add_argument(
            "--aimed",
            action="store_true",
            help="make: probings where it is open whether the effect can be told: a base slip in the markers alone, "
            "a registration near the noise, an energy form beside friction or drift",
        )
        parser.add_argument("--jobs", "-j", type=int, default=1, metavar="N", help="make, run: processes (default 1)")
        parser.add_argument("--case", action="append", default=[], metavar="NAME", help="run: only this case (repeat)")
        parser.add_argument("--again", action="store_true", help="run: diagnose again what has a result")
        parser.add_argument(
            "--number", metavar="PATH=VALUE", help="judge: one of the criteria at another value; nothing is rewritten"
        )
        parser.add_argument("--out", "-o", type=Path, metavar="FOLDER", help="grade, rivals: where to write")

    def run(self, given: argparse.Namespace) -> Reply:
        """Do one of the five."""
        positive(given.jobs, "--jobs")
        if given.action == "make":
            which = {"strong": given.strong, "pairs": given.pairs, "rest": given.rest, "aimed": given.aimed}
            made = make(
                given.folder,
                given.kind,
                given.count,
                given.seed,
                given.jobs,
                for_terminal(),
                commit=given.commit,
                **which,
            )
            text = (
                f"{len(made['cases'])} {given.kind} cases in {given.folder}\nkeys sealed, sha256 {made['keys_sha256']}"
            )
            return Reply(made, text)
        if given.action == "run":
            results = run(given.folder, given.jobs, tuple(given.case), given.again, for_terminal())
            record = {name: str(path) for name, path in results.items()}
            return Reply(
                {"results": record}, f"{len(results)} cases answered; next: tissuejax challenge grade {given.folder}"
            )
        if given.action == "judge":
            said = rejudge(given.folder, None if given.number is None else _criteria(given.number))
            counts = ", ".join(f"{kind} {n}" for kind, n in Counter(said.values()).most_common())
            after = "next: grade" if given.number is None else f"with {given.number}; nothing was rewritten"
            return Reply({"verdicts": said}, f"{len(said)} cases judged again from their evidence: {counts}; {after}")
        if given.action == "rivals":
            found = compare(given.folder, given.out, progress=for_terminal())
            return Reply(found, (given.out or given.folder).joinpath("rivals.csv").read_text())
        found = grade(given.folder, given.out)
        figures(found, given.out or given.folder)
        lines = [f"{found['answered']} of {found['cases']} cases answered", ""]
        for name, r in found["rates"].items():
            if r["of"]:
                lines.append(f"  {name:<58}{r['share']:>6.0%}  ({r['low']:.0%} to {r['high']:.0%}, n = {r['of']})")
        if (shown := found["channel_f1"])["of"]:
            lines.append(f"  {'channels that show the misfit: F1':<58}{shown['f1']:>6.2f}  (n = {shown['of']})")
        return Reply(found, "\n".join(lines))


def _criteria(text: str) -> Criteria:
    path, _, value = text.partition("=")
    try:
        number = float(value)
    except ValueError as error:
        raise InputError(f"--number {text}: give one as criteria.coarse=100") from error
    if not path.startswith("criteria."):
        raise InputError(f"--number {text}: evidence is judged by the criteria alone; give one as criteria.coarse=100")
    changed = Numbers().having(path, number).criteria
    if path.split(".")[1] not in JUDGED:
        raise InputError(
            f"--number {text}: sets are searched and weighed by it, and what it did is in the evidence already; judged "
            f"by are {', '.join(f'criteria.{name}' for name in JUDGED)}, any other asks for the diagnoses run again"
        )
    return changed
