"""The page of a diagnosis: for a colleague who was not there."""

from pathlib import Path

from tissuejax.diagnosis.judgement.evidence import write_evidence
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report import diagnosis_sentences as sentences
from tissuejax.report import judged_sentences as judged
from tissuejax.report.diagnosis_tables import write_curves, write_latex
from tissuejax.report.headline import headline
from tissuejax.report.page import figures, render, write_drawn
from tissuejax.storage import write_json, write_text


def write_diagnosis(found: Diagnosis, out: Path, remainders: bool = True, again: str = "") -> dict[str, Path]:
    """result.json, remainder.json, report.html, the figures, curves.csv and parameters.tex, each whole or not at all.

    Args:
        found: the diagnosis.
        out: folder, made if missing.
        again: the command that fits with what was named, for the record and the page.
        remainders: False leaves remainder.json out, which holds the residual sample by sample.

    Returns:
        Paths by name: "result", "remainder", "evidence", "page", "curves", "table", and the figures by name and by name
        and format.
    """
    out = Path(out)
    record = found.as_dict() | ({"fit": again} if again else {})
    written = {"result": write_json(out / "result.json", record)}
    if remainders:
        written["remainder"] = write_json(out / "remainder.json", found.remainders())
    written["evidence"] = write_evidence(found.answered.evidence, out / "evidence.json")
    drawn = figures(found)
    written |= write_drawn(drawn, out)
    page = render(
        "diagnosis.html.j2",
        title=f"Diagnosis of {found.sample}",
        d=found,
        record=record,
        headline=headline(found),
        lead=judged.lead(found),
        sure=judged.sure(found),
        limits=sentences.limits(found),
        parameters=sentences.parameters(found),
        base=sentences.base(found),
        places=sentences.places(found),
        meanings=sentences.meanings(found),
        steps=sentences.next_steps(found),
        sets=found.sets(),
        fits=len(record["sets"]),
        figures={f["name"]: f for f in drawn},
    )
    written["page"] = write_text(out / "report.html", page)
    written["curves"] = write_curves(found, out / "curves.csv")
    written["table"] = write_latex(found, out / "parameters.tex")
    return written
