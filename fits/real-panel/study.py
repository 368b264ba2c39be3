"""Sixty-six real samples whose cause is known from the protocol, and nineteen with none: is it named, and what else?

Every line of `causes.toml` is diagnosed as a user would: base energy named, one recording held out where there are
several, all effects of the catalogue allowed. One file a sample under `results/`; a stopped study goes on. Then tables.

tissuejax study fits/real-panel
PANEL_ONLY=beef,rubber tissuejax study fits/real-panel      protocols of these keys alone
PANEL_JUDGE=again tissuejax study fits/real-panel           judged again from the evidence that was kept (`runs/`)
"""

import json
import os
import sys
import time
import tomllib
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import panel_page
import panel_samples
from panel_samples import KEPT, file_of

import tissuejax as tj
from tissuejax.challenge.panel import answered, read_causes, summary
from tissuejax.diagnosis.judgement.evidence import read_evidence, write_evidence
from tissuejax.diagnosis.judgement.judge import judge
from tissuejax.diagnosis.judgement.rejudge import verdict_of
from tissuejax.progress import for_terminal
from tissuejax.storage import write_json


def diagnosed(entry: panel_samples.Entry, evidence: Path) -> dict:
    """What the diagnosis says of one sample, whose evidence is kept; a failure is an answer too."""
    begun = time.perf_counter()
    try:
        sample, held = panel_samples.build(entry)
        answer = tj.diagnose(sample, entry.energy, holdout=held, ogden_form=entry.ogden_form)
        write_evidence(answer.answered.evidence, evidence)
        found = answer.as_dict()
        record = {k: found[k] for k in KEPT if k in found}
    except Exception as error:
        trace = traceback.format_exc().splitlines()[-6:]
        record = {"verdict": "failed", "effects": [], "error": f"{type(error).__name__}: {error}", "trace": trace}
    return {"id": entry.id, "energy": entry.energy, **record, "seconds": time.perf_counter() - begun}


def judged_again(folder: Path, name: str) -> None:
    """Replace what the judgement alone decides, where the evidence is at hand."""
    path, evidence = file_of(folder, name), file_of(folder, name, "runs")
    if path.exists() and evidence.exists():
        write_json(path, json.loads(path.read_text()) | verdict_of(judge(read_evidence(evidence))))


def in_turn(entries: list[panel_samples.Entry]) -> list[panel_samples.Entry]:
    """The first sample of every protocol, then the second of each: a study that is stopped has some of everything."""
    seen: dict[tuple, int] = {}
    order = []
    for e in entries:
        protocol = (e.key, e.ogden_form, e.energy if e.key == "ecoflex" else "")
        seen[protocol] = seen.get(protocol, 0) + 1
        order.append((seen[protocol], e))
    return [e for _, e in sorted(order, key=lambda x: x[0])]


def main(folder: Path) -> str:
    """Diagnose what has no result yet, grade all that has one; returns the answer in a sentence."""
    causes, words = read_causes(folder / "causes.toml")
    listed = in_turn(panel_samples.entries(tomllib.loads((folder / "causes.toml").read_text())))
    wanted = [k for k in os.environ.get("PANEL_ONLY", "").split(",") if k]
    part, parts = (int(n) for n in os.environ.get("PANEL_PART", "0/1").split("/"))  # two processes share the work
    left = [e for e in listed if not file_of(folder, e.id).exists() and (not wanted or e.key in wanted)][part::parts]
    with for_terminal().stage(f"diagnosing {len(left)} samples", len(left)) as stage:
        for entry in left:
            if not file_of(folder, entry.id).exists():
                write_json(file_of(folder, entry.id), diagnosed(entry, file_of(folder, entry.id, "runs")))
            stage.advance(note=entry.id)
    if os.environ.get("PANEL_JUDGE") == "again":
        for entry in listed:
            judged_again(folder, entry.id)
    answers = []
    for cause in causes:
        if (path := file_of(folder, cause.id)).exists():
            answers.append(answered(cause, json.loads(path.read_text()), words))
    if not answers:
        return "no sample has been diagnosed yet"
    found = {"listed": len(causes), "answered": len(answers), **summary(answers)}
    write_json(folder / "result.json", found)
    panel_page.write(folder, answers, found)
    named, nulls = (found["rates"][k] for k in ("cause named and no wrong name", "nulls: a wrong physical name"))
    said = f"{found['answered']} of {found['listed']} samples"
    if named["of"]:
        said += f"; cause named without a wrong name in {named['share']:.0%} of {named['of']}"
    if nulls["of"]:
        said += f"; a wrong physical name on {nulls['share']:.0%} of {nulls['of']} nulls"
    return said


if __name__ == "__main__":
    print(main(Path(__file__).parent))
