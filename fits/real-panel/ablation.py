"""Does a number of the judgement matter on real recordings? The panel judged again from its evidence, in seconds.

python fits/real-panel/ablation.py [FOLDER]     with runs/ and results/, as the study fills them; this folder by default

Writes ablation.json and the table between its marks in README.md. What sets are weighed by is in their evidence.
"""

import json
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path += [str(HERE), str(HERE.parent / "challenge")]

from ablation_settings import settings  # noqa: E402
from panel_samples import file_of  # noqa: E402

from tissuejax.challenge.panel import answered, read_causes, summary  # noqa: E402
from tissuejax.diagnosis.judgement.evidence import read_evidence  # noqa: E402
from tissuejax.diagnosis.judgement.judge import judge  # noqa: E402
from tissuejax.diagnosis.judgement.rejudge import verdict_of  # noqa: E402
from tissuejax.storage import write_between, write_json  # noqa: E402

BEGIN, END = "<!-- ablation: written by ablation.py -->", "<!-- end of ablation -->"
COLUMNS = ("cause named and no wrong name", "cause named, whatever else", "nulls: a wrong physical name")


def main(folder: Path) -> None:
    """Judge, grade, write."""
    causes, words = read_causes(HERE / "causes.toml")
    stored = {}
    for cause in causes:
        result, runs = file_of(folder, cause.id), file_of(folder, cause.id, "runs")
        if result.exists() and runs.exists():
            stored[cause.id] = (json.loads(result.read_text()), read_evidence(runs))
    found, rows = {}, []
    for label, criteria in settings(simulated=False):
        marks = [
            answered(c, stored[c.id][0] | verdict_of(judge(stored[c.id][1], criteria), criteria), words)
            for c in causes
            if c.id in stored
        ]
        said = summary(marks)
        rates = [said["rates"][name] for name in COLUMNS]
        error = said["calibration"]["expected_calibration_error"]
        found[label] = {"rates": dict(zip(COLUMNS, rates, strict=True)), "calibration_error": error}
        rows.append(f"| {label} | " + " | ".join(f"{r['share']:.0%}" for r in rates) + f" | {error:.2f} |")
    write_json(HERE / "ablation.json", {"samples": len(stored), "settings": found})
    head = [f"| criteria ({len(stored)} samples) | {' | '.join(COLUMNS)} | calibration error |", "|---" * 5 + "|"]
    write_between(HERE / "README.md", BEGIN, END, "\n".join([*head, *rows]))
    print("\n".join(rows))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else HERE)
