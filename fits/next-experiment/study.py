"""Does the proposed experiment settle what the recordings leave open? Simulated from a truth by other code.

Recordings are made that two explanations fit alike; the diagnosis says "ambiguous" and proposes a protocol; the
protocol is simulated from the truth by the closed forms of the challenge, which share no code with the diagnosis, and
the diagnosis runs again with that recording. As a control the first recording is made once more instead.

tissuejax study fits/next-experiment
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.challenge.material import Ingredient, Specimen, reported
from tissuejax.challenge.protocols import path
from tissuejax.challenge.specimen import Trial
from tissuejax.challenge.strain_laws import Body
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.report.page import png
from tissuejax.report.plot import FAINT, MODEL, grid
from tissuejax.storage import write_bytes, write_json

BODY = Body({"10": 600.0, "20": 500.0})
ENERGY, NOISE = "reduced-polynomial-2", 6.0
AREA, HEIGHT, DIAMETER = 5.0e-4, 0.025, 0.0252
X = np.array([1.0, 0.0, 0.0])


def trial(name: str, kind: str, levels: list[float], start: float, rate: float = 0.03, hold: float = 0.0) -> Trial:
    """Level after level at one rate and back to rest."""
    time, drive = path(levels, rate, [hold] * len(levels), 0.08, 1.0)
    return Trial(name, kind, time, drive, X, start, AREA, HEIGHT, DIAMETER)


def recording(specimen: Specimen, t: Trial, rng: np.random.Generator) -> Recording:
    """What would be recorded, with noise."""
    stress = reported(specimen, t) + NOISE * rng.standard_normal(len(t.time))
    attributes = {
        "start": t.start,
        "area": t.area,
        "height": t.height,
        "diameter": t.diameter,
        "direction": t.direction,
    }
    inputs = {"time": t.time, "stretch": t.drive}
    return Recording(t.name, t.kind, inputs, {"nominal_stress": Channel(t.time, stress, "Pa", NOISE)}, attributes)


def carried_out(specimen: Specimen, planned: Recording, name: str, rng: np.random.Generator) -> Recording:
    """A proposed protocol, done to the specimen in truth."""
    a = planned.attributes
    direction = np.asarray(a.get("direction", X), float)
    time, drive = (np.asarray(planned.inputs[k], float) for k in ("time", "stretch"))
    t = Trial(name, planned.experiment, time, drive, direction, float(a["start"]), AREA, float(a["height"]), DIAMETER)
    return recording(specimen, t, rng)


PULLS = (
    trial("pull", "uniaxial", [1.35], 0.0),
    trial("further", "uniaxial", [1.28], 600.0),
    trial("last", "uniaxial", [1.32], 1200.0),
)
CASES = {
    "relaxation": Ingredient("viscoelasticity", "prony", 0.008, {"shares": [1.0], "tau": [4.0]}),
    "draining": Ingredient("compressibility", "drained", 0.01, {"tau": 4.0}),
}
DRAWS = 8  # of the noise


def told(found) -> dict:
    """The verdict in brief."""
    record = found.as_dict()
    return {
        "verdict": record["verdict"],
        "effects": [e["name"] for e in record["effects"]],
        "or": [a["effects"] for a in record["alternatives"]],
        "confidence": record["confidence"],
    }


def case(ingredient: Ingredient, seed: int) -> dict:
    """One draw of the noise, from the recordings to the settled verdict, with the control."""
    specimen = Specimen(BODY, (ingredient,))
    rng = np.random.default_rng(seed)
    recordings = {t.name: recording(specimen, t, rng) for t in PULLS}
    first = tj.diagnose(Sample("case", recordings), ENERGY, holdout="last")
    out = {"truth": ingredient.name, "first": told(first), "proposals": [p.as_dict() for p in first.proposals]}
    if not first.proposals:
        return out
    best = first.proposals[0]
    out["proposed"], out["discrimination"] = best.protocol, best.discrimination
    done = carried_out(specimen, best.recording, "proposed", rng)
    out["then"] = told(tj.diagnose(Sample("case", {**recordings, "proposed": done}), ENERGY, holdout="last"))
    once_more = recording(specimen, replace(PULLS[0], name="again", start=1800.0), rng)
    out["control"] = told(tj.diagnose(Sample("case", {**recordings, "again": once_more}), ENERGY, holdout="last"))
    return out


def settled(record: dict, step: str) -> bool:
    """Whether a step ended with the truth and nothing else."""
    return record[step]["verdict"] == "found" and record[step]["effects"] == [record["truth"]]


def picture(records: dict) -> bytes:
    """Confidence in the truth alone: before, after a repeat, after the proposed protocol."""
    figure, axes = grid(len(records), columns=2, height=3.0)
    steps = ("first", "control", "then")
    for ax, (name, cases) in zip(axes, records.items(), strict=True):
        for c in cases:
            if "then" in c:
                right = [c[s]["confidence"] if c[s]["effects"][:1] == [c["truth"]] else 0.0 for s in steps]
                ax.plot(range(3), right, "o-", color=MODEL if settled(c, "then") else FAINT, alpha=0.6)
        ax.set_xticks(range(3), ["three pulls", "a pull again", "what was proposed"])
        ax.set(title=f"truth: {name}", ylabel="confidence in the truth", ylim=(-0.05, 1.05))
    return png(figure)


def main(folder: Path) -> str:
    """All cases and draws; returns the answer in a sentence."""
    records = {n: [case(c, seed) for seed in range(1, DRAWS + 1)] for n, c in CASES.items()}
    summary = {}
    for name, cases in records.items():
        open_ = [c for c in cases if c["first"]["verdict"] == "ambiguous" and "then" in c]
        summary[name] = {
            "draws": len(cases),
            "ambiguous_at_first": len(open_),
            "settled_by_the_proposal": sum(settled(c, "then") for c in open_),
            "settled_by_a_repeat": sum(settled(c, "control") for c in open_),
            "proposed": sorted({c["proposed"] for c in open_}),
            "wrong_at_first": sum(c["first"]["verdict"] == "found" and not settled(c, "first") for c in cases),
        }
    write_json(folder / "result.json", {"summary": summary, "cases": records})
    write_bytes(folder / "figures" / "confidence.png", picture(records))
    return "; ".join(
        f"{n}: {s['ambiguous_at_first']} of {s['draws']} ambiguous, {s['settled_by_the_proposal']} settled by what was "
        f"proposed ({', '.join(s['proposed'])}), {s['settled_by_a_repeat']} by a repeat"
        for n, s in summary.items()
    )


if __name__ == "__main__":
    print(main(Path(__file__).parent))
