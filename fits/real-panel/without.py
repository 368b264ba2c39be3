"""May numbers of a search go? Searches in which they stand where they decide nothing, beside the usual ones.

python fits/real-panel/without.py effort.spare=0 effort.parents.1=3,effort.spare=0
                                          each argument is a question: numbers and values, parted by commas
python fits/real-panel/without.py table   without.csv: what each question changes, of all samples that were asked it

MATTERS_EVERY and MATTERS_PART as for matters.py. Stopped, it goes on where it was (runs/without/).
"""

import csv
import io
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import matters  # noqa: E402
from panel_samples import file_of  # noqa: E402
from remembered import Remembered  # noqa: E402
from threadpoolctl import threadpool_limits  # noqa: E402

from tissuejax.cache.programs import keep_programs  # noqa: E402
from tissuejax.cache.source import LOADED  # noqa: E402
from tissuejax.diagnosis.judgement.numbers import Numbers  # noqa: E402
from tissuejax.progress import for_terminal  # noqa: E402
from tissuejax.storage import write_json, write_text  # noqa: E402

RUNS = HERE / "runs" / "without"
USUAL = "as they are"


def numbers_of(question: str) -> Numbers:
    """The numbers of a question."""
    at = Numbers()
    for item in question.split(",") if question != USUAL else ():
        path, _, value = item.partition("=")
        at = at.having(path, float(value))
    return at


def changed(usual: Mapping, other: Mapping) -> tuple[bool, float]:
    """Whether an answer is another one, and the largest change of a verdict's or an effect's probability."""
    said = [(a["verdict"], sorted(e["name"] for e in a["effects"])) for a in (usual, other)]
    moved = [
        abs(usual[kind].get(k, 0.0) - other[kind].get(k, 0.0))
        for kind in ("probabilities", "inclusion")
        for k in {*usual[kind], *other[kind]}
    ]
    return said[0] != said[1], max(moved, default=0.0)


def table() -> str:
    """without.csv, and the same as text."""
    stored: dict[str, dict[str, dict]] = {}
    for folder in sorted(p for p in RUNS.iterdir() if p.is_dir()):
        for path in sorted(folder.glob("*.json")):
            if (found := matters.known(path)) is not None:
                stored.setdefault(found["question"], {})[path.stem] = found["said"]
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(["numbers", "samples", "answers that change", "largest change of a probability", "which", "code"])
    for question, answers in stored.items():
        if question != USUAL:
            told = {id: changed(stored[USUAL][id], said) for id, said in answers.items()}
            which = "; ".join(id for id, (differs, _) in told.items() if differs)
            most = max(x for _, x in told.values())
            counts = [len(told), sum(differs for differs, _ in told.values()), f"{most:.2g}", which, LOADED[:10]]
            lines.writerow([question, *counts])
    write_text(HERE / "without.csv", text.getvalue())
    return text.getvalue()


def main(given: Sequence[str]) -> str:
    """Ask what was not asked yet."""
    if not given or given[0] in ("-h", "--help"):
        return __doc__ or ""
    if list(given) == ["table"]:
        return table()
    part, parts = (int(n) for n in os.environ.get("MATTERS_PART", "0/1").split("/"))
    asked = {USUAL: Numbers(), **{question: numbers_of(question) for question in given}}
    mine = matters.samples()[part::parts]
    keep_programs()
    whole = for_terminal().stage(f"{len(asked)} questions to {len(mine)} samples", len(asked) * len(mine))
    with whole as stage, threadpool_limits(1, "blas"):
        for entry in mine:
            sets = Remembered()
            for question, at in asked.items():
                kept = file_of(RUNS, entry.id, question.replace(" ", "-"))
                if matters.known(kept) is None:
                    said, _ = matters.searched(entry, at, sets)
                    write_json(kept, {"question": question, "said": said, "code": LOADED})
                stage.advance(note=f"{question}: {entry.id}")
    return table() if parts == 1 else "kept in runs/without"


if __name__ == "__main__":
    print(main(sys.argv[1:]))
