"""How rare are faults of the rig in real recordings? Asked of the panel's evidence alone: no cause is read.

python fits/real-panel/rarity.py [FOLDER]     with runs/, as the study fills it; this folder by default

The probability of all recordings together, as `judge` weighs sets, for odds of a fault against what a law lacks
(`Criteria.fault`): its maximum is the estimate, and where it falls by two nats the interval (empirical Bayes). Writes
rarity.json and the table between its marks in README.md.
"""

import sys
from dataclasses import replace
from pathlib import Path

from scipy.special import logsumexp

HERE = Path(__file__).resolve().parent

from tissuejax.diagnosis.judgement.criteria import Criteria  # noqa: E402
from tissuejax.diagnosis.judgement.evidence import Evidence, read_evidence  # noqa: E402
from tissuejax.diagnosis.judgement.judge import weighted  # noqa: E402
from tissuejax.errors import InputError  # noqa: E402
from tissuejax.storage import write_between, write_json  # noqa: E402

ODDS = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005)
BEGIN, END = "<!-- rarity: written by rarity.py -->", "<!-- end of rarity -->"


def probability(e: Evidence, odds: float) -> float:
    """Log probability of a sample's recordings, all sets together, nats and a constant."""
    return float(logsumexp([weight for weight, _ in weighted(e, replace(Criteria(), fault=odds))]))


def main(folder: Path) -> None:
    """Sum over all samples, and over those of each kind of tissue."""
    found = {f.stem: read_evidence(f) for f in sorted((folder / "runs").glob("*.json"))}
    if old := [name for name, e in found.items() if not e.faults]:
        raise InputError(f"{', '.join(old)}: the evidence does not say which effects are faults; diagnose again")
    kinds = sorted({name.split("-")[0] for name in found})
    rows, table = [], {}
    for odds in ODDS:
        gained = {n: probability(e, odds) - probability(e, 1.0) for n, e in found.items()}
        own = {k: sum(g for n, g in gained.items() if n.split("-")[0] == k) for k in kinds}
        table[str(odds)] = {"all": sum(gained.values()), **own}
        rows.append(
            f"| {odds:g} | **{sum(gained.values()):.1f}** | " + " | ".join(f"{own[k]:.1f}" for k in kinds) + " |"
        )
    write_json(HERE / "rarity.json", {"samples": len(found), "gained": table})
    head = [f"| odds ({len(found)} samples) | all | {' | '.join(kinds)} |", "|---" * (len(kinds) + 2) + "|"]
    write_between(HERE / "README.md", BEGIN, END, "\n".join([*head, *rows]))
    print("\n".join(rows))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else HERE)
