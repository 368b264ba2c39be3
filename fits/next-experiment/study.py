"""Does the proposed experiment settle what the recordings leave open? Simulated from a truth by other code.

Recordings of an effect that grows by factors of two, from one that noise hides. Where the answer leaves more than a
tenth open the diagnosis proposes a protocol; that is simulated from the truth by the closed forms of the challenge,
which share no code with the diagnosis, and the diagnosis runs again with that recording. As a control the first
recording is made once more instead.

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
from tissuejax.report.plot import SERIES, grid
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
    "relaxation": lambda share: Ingredient("viscoelasticity", "prony", share, {"shares": [1.0], "tau": [4.0]}),
    "draining": lambda share: Ingredient("compressibility", "drained", share, {"tau": 4.0}),
}
SHARES = (0.01, 0.02, 0.04, 0.08, 0.16)  # of the stress that relaxes; the compressibility that drains
SEEDS = (11, 12, 13)  # of the noise, at each; 1 to 3 were seen while the order of proposals was made


def told(found, truth: str) -> dict:
    """The verdict in brief."""
    record = found.as_dict()
    named = [e["name"] for e in record["effects"]] if record["verdict"] != "ambiguous" else []
    return {
        "verdict": record["verdict"],
        "named": named,
        "confidence": record["confidence"],
        "truth": record["inclusion"].get(truth, 0.0),
    }


def case(name: str, share: float, seed: int) -> dict:
    """One draw of the noise, from the recordings to the verdict with what was proposed, and with the control."""
    ingredient = CASES[name](share)
    specimen = Specimen(BODY, (ingredient,))
    rng = np.random.default_rng(seed)
    recordings = {t.name: recording(specimen, t, rng) for t in PULLS}

    def asked(**more: Recording) -> dict:
        return told(tj.diagnose(Sample("case", {**recordings, **more}), ENERGY, holdout="last"), ingredient.name)

    first = tj.diagnose(Sample("case", recordings), ENERGY, holdout="last")
    out = {
        "share": share,
        "truth": ingredient.name,
        "first": told(first, ingredient.name),
        "proposals": [p.as_dict() for p in first.proposals],
    }
    if not first.proposals:
        return out
    best = first.proposals[0]
    out |= {"proposed": best.protocol, "discrimination": best.discrimination}
    out["then"] = asked(proposed=carried_out(specimen, best.recording, "proposed", rng))
    out["control"] = asked(again=recording(specimen, replace(PULLS[0], name="again", start=1800.0), rng))
    return out


def right(record: dict, step: str) -> bool:
    """Whether the truth is named at a step, and nothing else."""
    return record[step]["named"] == [record["truth"]]


def wrong(record: dict, step: str) -> bool:
    """Whether something else is named."""
    return bool(set(record[step]["named"]) - {record["truth"]})


def picture(records: dict) -> bytes:
    """Probability of the truth: before, after a repeat, after the proposed protocol."""
    figure, axes = grid(len(records), columns=2, height=3.0)
    steps = ("first", "control", "then")
    for ax, (name, cases) in zip(axes, records.items(), strict=True):
        for colour, share in zip(SERIES, SHARES, strict=False):
            for k, c in enumerate(c for c in cases if c["share"] == share and "then" in c):
                label = f"{share:.0%}" if k == 0 else None
                ax.plot(range(3), [c[s]["truth"] for s in steps], "o-", color=colour, alpha=0.7, label=label)
        ax.set_xticks(range(3), ["three pulls", "a pull again", "what was proposed"])
        ax.set(title=f"truth: {name}", ylabel="probability of the truth", ylim=(-0.05, 1.05))
        if ax.lines:
            ax.legend(fontsize=7, frameon=False)
    return png(figure)


def main(folder: Path) -> str:
    """All cases and draws; returns the answer in a sentence."""
    records = {n: [case(n, s, seed) for s in SHARES for seed in SEEDS] for n in CASES}
    rows = []
    for name, cases in records.items():
        for share in SHARES:
            of = [c for c in cases if c["share"] == share]
            open_ = [c for c in of if "then" in c]
            rows.append(
                {"truth": name, "share": share, "draws": len(of), "named at once": sum(right(c, "first") for c in of)}
                | {"proposed": len(open_)}
                | {f"right {step}": sum(right(c, step) for c in open_) for step in ("first", "control", "then")}
                | {f"wrong {step}": sum(wrong(c, step) for c in open_) for step in ("first", "control", "then")}
                | {"what": sorted({c["proposed"] for c in open_})}
            )
    write_json(folder / "result.json", {"rows": rows, "cases": records})
    write_bytes(folder / "figures" / "confidence.png", picture(records))
    whole = {k: sum(r[k] for r in rows) for k in rows[0] if k not in ("truth", "share", "what")}
    return (
        f"of {whole['draws']} samples {whole['proposed']} left something open; right of these before "
        f"{whole['right first']}, with a pull again {whole['right control']}, with what was proposed "
        f"{whole['right then']} (wrong names {whole['wrong first']}, {whole['wrong control']}, {whole['wrong then']})"
    )


if __name__ == "__main__":
    print(main(Path(__file__).parent))
