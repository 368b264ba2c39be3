"""Which numbers of the judgement matter on real recordings? Each halved and doubled, on some of them.

tissuejax/diagnosis/judgement/numbers.py lists the numbers by path. What sets are weighed by is changed beside the sets
that a search with the usual numbers had found, each from where it came to rest; what decides which sets are tried, or
what is looked for in the recordings first, is searched anew, no set of a sample weighed twice (remembered.py); what a
judge alone reads is judged anew. Stopped, it goes on where it was (runs/matters/), by the same code.

python fits/real-panel/matters.py list                        all numbers, and which way each is asked
python fits/real-panel/matters.py found                       search with the usual numbers (once; 6 minutes of a core)
python fits/real-panel/matters.py criteria.rig 2              one number and a factor
python fits/real-panel/matters.py criteria.rig effort.hopeful each halved and doubled
python fits/real-panel/matters.py all                         each number halved and doubled
python fits/real-panel/matters.py table                       matters.csv, matters.png and the table in README.md again

MATTERS_PART=0/2 shares the samples between two processes; `table` is asked when both are done. MATTERS_EVERY=12 asks
every twelfth sample. A table keeps what matters.csv has of other runs about the same samples, each row with the hash of
its code.
"""

import csv
import io
import json
import os
import sys
import time
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import panel_samples  # noqa: E402
from panel_samples import file_of  # noqa: E402
from remembered import Remembered  # noqa: E402
from threadpoolctl import threadpool_limits  # noqa: E402

from tissuejax.cache.programs import keep_programs  # noqa: E402
from tissuejax.cache.source import LOADED  # noqa: E402
from tissuejax.challenge.panel import Answer, answered, read_causes  # noqa: E402
from tissuejax.diagnosis.diagnose import asked_of  # noqa: E402
from tissuejax.diagnosis.judgement import rejudge  # noqa: E402
from tissuejax.diagnosis.judgement.evidence import read_evidence, write_evidence  # noqa: E402
from tissuejax.diagnosis.judgement.judge import judge  # noqa: E402
from tissuejax.diagnosis.judgement.numbers import Numbers  # noqa: E402
from tissuejax.diagnosis.judgement.reweigh import Found, reweighed  # noqa: E402
from tissuejax.diagnosis.judgement.search import Setup, explore  # noqa: E402
from tissuejax.errors import InputError  # noqa: E402
from tissuejax.progress import for_terminal  # noqa: E402
from tissuejax.report.matters import matters_figure  # noqa: E402
from tissuejax.storage import write_between, write_figure, write_json, write_text  # noqa: E402

BEGIN, END = "<!-- matters: written by matters.py -->", "<!-- end of matters -->"
RUNS = HERE / "runs" / "matters"
EVERY, FACTORS = int(os.environ.get("MATTERS_EVERY", "4")), (0.5, 2.0)
# These decide what is tried or looked for, before any set is weighed: asked by a search.
SEARCHED = (
    "effort",
    "criteria.shown",
    "criteria.means",
    "criteria.sudden",
    "criteria.recurs",
    "criteria.shares.sudden",
)
SEARCHED += tuple(f"criteria.smooth.{name}" for name in ("clock", "edge", "moments", "jump", "farther", "followed"))
# A judge alone reads these: the sets as they are weighed usually, judged again.
JUDGED = tuple(f"criteria.{name}" for name in rejudge.JUDGED if name != "lapse")
# Of other kinds of recordings, or of a page: no sample of the panel feels them.
ELSEWHERE = ("criteria.lapse", "criteria.simulated", "criteria.strokes", "criteria.unseen", "criteria.twins")
ELSEWHERE += ("criteria.means.least",)  # of more than sixteen series
ELSEWHERE += tuple(f"effort.{name}" for name in ("promised", "shown", "rivals", "course.shortened"))
ELSEWHERE += tuple(f"criteria.shares.{name}" for name in ("marker", "onset", "peak", "numerical"))
USUAL = "as they are"
COLUMNS = ("answers that change", "cause named", "a wrong name", "null alarms")


def under(path: str, heads: Sequence[str]) -> bool:
    """Whether a number stands under one of these."""
    return any(path == head or path.startswith(head + ".") for head in heads)


def samples() -> list[panel_samples.Entry]:
    """Every `EVERY`th sample in the order of causes.toml, whatever was said of it."""
    return panel_samples.entries(tomllib.loads((HERE / "causes.toml").read_text()))[::EVERY]


def numbers() -> list[str]:
    """Those that a sample of the panel can feel, and that have a half and a double."""
    return [p for p, x in Numbers().all().items() if x and not under(p, ELSEWHERE)]


def way_of(path: str) -> str:
    """How a number is asked."""
    return "searched" if under(path, SEARCHED) else "weighed"


def name_of(path: str, factor: float) -> str:
    """Of a question."""
    return USUAL if path == USUAL else f"{path} x {factor:g}"


def searched(entry: panel_samples.Entry, at: Numbers, kept: Remembered | None = None) -> tuple[dict, Found]:
    """The verdict of a search, and what it leaves to be weighed again.

    Args:
        kept: sets that other searches of the sample have weighed.
    """
    sample, held = panel_samples.build(entry)
    asked = asked_of(sample, entry.energy, held, entry.ogden_form, criteria=at.criteria)
    cut, of = asked.left()
    found = explore(asked.searched(cut), cut, of, Setup(at.criteria, at.effort, kept=kept or Remembered()))
    evidence = found.evidence(asked.bench.fitted, asked.bench.held_out)
    said = rejudge.verdict_of(judge(evidence, at.criteria), at.criteria)
    return said, Found.of(found, evidence.held_out)


def weighed(entry: panel_samples.Entry, path: str, at: Numbers, found: Found) -> dict:
    """The verdict of the sets found, weighed again; judged again where only a judge reads the number."""
    usual = file_of(RUNS, entry.id, "evidence")
    if under(path, JUDGED):
        return rejudge.verdict_of(judge(read_evidence(usual), at.criteria), at.criteria)
    sample, held = panel_samples.build(entry)
    asked = asked_of(sample, entry.energy, held, entry.ogden_form, criteria=at.criteria)
    cut, of = asked.left()
    evidence = reweighed(asked.searched(cut), cut, of, found, at.criteria)
    if path == USUAL:
        write_evidence(evidence, usual)
    return rejudge.verdict_of(judge(evidence, at.criteria), at.criteria)


def known(path: Path) -> dict | None:
    """What was answered before by this very code; None where it was not."""
    said = json.loads(path.read_text()) if path.exists() else {}
    return said if said.get("code") == LOADED else None


def answer(entry: panel_samples.Entry, path: str, factor: float, sets: Remembered) -> None:
    """Ask one sample, unless it was asked before; `sets` that were weighed for it."""
    kept = file_of(RUNS, entry.id, name_of(path, factor).replace(" ", "-"))
    if known(kept) is not None:
        return
    base = file_of(RUNS, entry.id, "found")
    if known(base) is None:
        verdict, found = searched(entry, Numbers(), sets)
        write_json(base, {"searched": verdict, "found": found.as_dict(), "code": LOADED})
    if path == "found":
        return
    begun, stored = time.perf_counter(), json.loads(base.read_text())
    try:
        if path == USUAL:
            said = {
                "searched": stored["searched"],
                "weighed": weighed(entry, path, Numbers(), Found.read(stored["found"])),
            }
        elif under(path, SEARCHED):
            said = {"searched": searched(entry, Numbers().changed(path, factor), sets)[0]}
        else:
            said = {"weighed": weighed(entry, path, Numbers().changed(path, factor), Found.read(stored["found"]))}
    except Exception as error:  # a number may make a sample impossible: that is an answer too
        said = {"failed": f"{type(error).__name__}: {error}"}
    write_json(kept, said | {"seconds": time.perf_counter() - begun, "code": LOADED})


def marked(path: str, factor: float, way: str) -> list[Answer]:
    """The answers of all samples, graded."""
    causes, words = read_causes(HERE / "causes.toml")
    of, out = {c.id: c for c in causes}, []
    for entry in samples():
        kept = file_of(RUNS, entry.id, name_of(path, factor).replace(" ", "-"))
        if (said := known(kept)) is not None:
            out.append(answered(of[entry.id], said.get(way, {"verdict": "failed", "effects": []}), words))
    return out


def row(path: str, factor: float, way: str, usual: dict[str, Answer]) -> dict | None:
    """What one change does; None where not all samples were asked."""
    found = marked(path, factor, way)
    if len(found) < len(samples()):
        return None
    said = {id: (a.verdict, set(a.named)) for id, a in usual.items()}
    differs = [a.cause.id for a in found if (a.verdict, set(a.named)) != said[a.cause.id]]
    caused, nulls = [a for a in found if not a.cause.null], [a for a in found if a.cause.null]
    return {
        "number": path,
        "factor": factor,
        "asked by": way,
        COLUMNS[0]: len(differs),
        COLUMNS[1]: sum(a.met for a in caused),
        COLUMNS[2]: sum(bool(a.wrong) for a in caused),
        COLUMNS[3]: sum(bool(a.wrong) for a in nulls),
        "mean change of confidence": sum(abs(a.confidence - usual[a.cause.id].confidence) for a in found) / len(found),
        "of": len(caused),
        "nulls": len(nulls),
        "which": "; ".join(differs),
        "every": EVERY,
        "code": LOADED[:10],
    }


def table() -> str:
    """All that was asked of every sample: matters.csv, matters.png, and the table in README.md."""
    usual = {way: {a.cause.id: a for a in marked(USUAL, 1.0, way)} for way in ("searched", "weighed")}
    if len(usual["weighed"]) < len(samples()):
        raise InputError("not all samples were asked with the usual numbers: matters.py found, then any number")
    base = [row(USUAL, 1.0, way, usual[way]) for way in usual]
    rows = [r for r in base if r is not None]
    before = asked_before()
    for path in numbers():
        way = way_of(path)
        asked = [row(path, factor, way, usual[way]) or before.get((path, factor)) for factor in FACTORS]
        rows += [r for r in asked if r is not None]
    text = io.StringIO()
    lines = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    lines.writeheader()
    lines.writerows({k: f"{v:.3g}" if isinstance(v, float) else v for k, v in r.items()} for r in rows)
    write_text(HERE / "matters.csv", text.getvalue())
    write_figure(HERE / "matters.png", matters_figure(rows[2:], COLUMNS[0]), dpi=100)
    head = f"| number | times | asked by | {' | '.join(COLUMNS)} |"
    of = f"of {len(samples())} samples, {rows[0]['of']} with a cause and {rows[0]['nulls']} nulls"
    shown = [
        f"| {r['number']} | {r['factor']:g} | {r['asked by']} | " + " | ".join(str(r[c]) for c in COLUMNS) + " |"
        for r in rows[:2] + sorted(rows[2:], key=lambda r: -r[COLUMNS[0]])
        if r in rows[:2] or r[COLUMNS[0]]
    ]
    still = [r["number"] for r in rows[2:] if not r[COLUMNS[0]]]
    quiet = sorted(p for p in set(still) if still.count(p) == len(FACTORS))
    codes = sorted({r["code"] for r in rows})
    by = f"Code by its hash: {', '.join(codes)}."
    said = f"{by} Of {len(rows[2:])} changes {len(still)} change no answer. Neither does of: {', '.join(quiet)}."
    body = "\n".join([f"Counts {of}.", "", head, "|---" * 7 + "|", *shown, "", said])
    write_between(HERE / "README.md", BEGIN, END, body)
    return said


def asked_before() -> dict[tuple[str, float], dict]:
    """What matters.csv has of other runs about the same samples: hours that one machine need not spend at once."""
    path = HERE / "matters.csv"
    lines = list(csv.DictReader(path.open())) if path.exists() else []
    found = {}
    for line in lines:
        known: dict = {**line, "factor": float(line["factor"]), **{k: int(line[k]) for k in COLUMNS}}
        if line["every"] == str(EVERY):
            found[line["number"], known["factor"]] = known
    return found


def questions(given: Sequence[str]) -> Iterator[tuple[str, float]]:
    """What the command line asks, the usual numbers first."""
    if given[0] == "found":
        yield "found", 1.0
        return
    yield USUAL, 1.0
    paths = numbers() if given == ["all"] else [g for g in given if not _factor(g)]
    factors = [f for g in given if (f := _factor(g))] or FACTORS
    for path in paths:
        for factor in factors:
            Numbers().changed(path, factor)  # refused here, before an hour of work
            yield path, factor


def _factor(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0


def main(given: Sequence[str]) -> str:
    """Ask what was not asked yet."""
    if not given or given[0] in ("-h", "--help"):
        return __doc__ or ""
    if given[0] == "list":
        ways = {p: "judged" if under(p, JUDGED) else way_of(p) for p in numbers()}
        return "\n".join(f"{p:<40}{Numbers().all()[p]:<12g}{ways[p]}" for p in ways)
    if given[0] == "table":
        return table()
    part, parts = (int(n) for n in os.environ.get("MATTERS_PART", "0/1").split("/"))
    mine, asked = samples()[part::parts], list(questions(list(given)))
    whole = for_terminal().stage(f"{len(asked)} questions to {len(mine)} samples", len(asked) * len(mine))
    with whole as stage, threadpool_limits(1, "blas"):
        keep_programs()
        for entry in mine:
            sets = Remembered()
            for path, factor in asked:
                answer(entry, path, factor, sets)
                stage.advance(note=f"{name_of(path, factor)}: {entry.id}")
    return table() if parts == 1 and asked[0][0] != "found" else "kept in runs/matters"


if __name__ == "__main__":
    print(main(sys.argv[1:]))
