"""Does the verdict flip when a user chooses otherwise? Base energy, held-out recording, sampling, noise, gain.

Four samples from closed forms (none of the package's code): nothing concealed, relaxation (both in `data/demo`), plates
that rub and a rig that gives way (`fits/held-out-geometry`). Each is diagnosed
as it stands and with one choice changed.

tissuejax study fits/robustness
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.storage import write_json

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "fits" / "held-out-geometry"))

from study import sample as specimens  # noqa: E402

TRUTH = {  # of the sample: what is concealed, and what it is diagnosed with
    "elastic": ((), "holdout", "tension"),
    "relaxing": (("viscoelasticity",), "holdout", "tension"),
    "rubbing": (("platen-friction",), "flat", "even"),
    "giving way": (("machine-compliance",), "thick", "even"),
}


def load(name: str) -> Sample:
    """The sample as it stands."""
    if name in ("elastic", "relaxing"):
        return read(ROOT / "data" / "demo" / f"{name}.h5")
    return specimens({"rubbing": "platen-friction", "giving way": "machine-compliance"}[name], 0)


def changed(sample: Sample, change: Callable[[Recording], Recording]) -> Sample:
    """All recordings changed alike."""
    return replace(sample, recordings={k: change(r) for k, r in sample.recordings.items()})


def channels(r: Recording, change: Callable[[Channel], Channel]) -> Recording:
    """All channels of a recording changed alike."""
    return replace(r, channels={k: change(c) for k, c in r.channels.items()})


def halved(r: Recording) -> Recording:
    """Every second sample."""
    inputs = {k: np.asarray(v)[::2] for k, v in r.inputs.items()}
    return channels(
        replace(r, inputs=inputs), lambda c: replace(c, time=np.asarray(c.time)[::2], values=np.asarray(c.values)[::2])
    )


def noisier(factor: float) -> Callable[[Recording], Recording]:
    """Another stated noise."""
    return lambda r: channels(r, lambda c: replace(c, noise_std=c.noise_std * factor))


def gained(r: Recording) -> Recording:
    """A load cell that reads 5 % more."""
    return channels(r, lambda c: replace(c, values=np.asarray(c.values) * 1.05))


def choices(name: str) -> dict[str, tuple[Sample, str, str]]:
    """By choice: sample, base energy, recording held out."""
    sample, base = load(name), "reduced-polynomial-2"
    _, held, other = TRUTH[name]
    return {
        "as it stands": (sample, base, held),
        "base Ogden-2": (sample, "ogden-2", held),
        "base neo-Hooke": (sample, "neo-hookean", held),
        "another held out": (sample, base, other),
        "every second sample": (changed(sample, halved), base, held),
        "noise stated twice": (changed(sample, noisier(2.0)), base, held),
        "noise stated half": (changed(sample, noisier(0.5)), base, held),
        "gain 5 % too large": (changed(sample, gained), base, held),
    }


def asked(sample: Sample, base: str, held: str) -> dict:
    """One diagnosis in a line."""
    form = {"ogden_form": "2mu/alpha^2"} if base.startswith("ogden") else {}
    found = tj.diagnose(sample, base, holdout=(held,), **form).as_dict()
    return {
        "verdict": str(found["verdict"]),
        "named": [e["name"] for e in found["effects"]],
        "stated": found["confidence"],
    }


def main(folder: Path) -> str:
    """Run, write the table into the page, and say in a line what came out."""
    rows, lines = [], ["| sample | choice | verdict | named | stated | right |", "|---|---|---|---|---|---|"]
    with for_terminal().stage("robustness", total=8 * len(TRUTH)) as stage:
        for name, (truth, *_) in TRUTH.items():
            for choice, given in choices(name).items():
                r = asked(*given)
                beside = {"energy-form"} if choice == "base neo-Hooke" else set()  # the blocks are none
                r["right"] = set(truth) <= set(r["named"]) and set(r["named"]) <= {*truth, *beside}
                rows.append({"sample": name, "choice": choice, **r})
                named = " + ".join(r["named"]) or "-"
                right = "yes" if r["right"] else "**no**"
                lines.append(f"| {name} | {choice} | {r['verdict']} | {named} | {r['stated']:.3f} | {right} |")
                stage.advance(1)
    write_json(folder / "result.json", {"answers": rows})
    page = folder / "README.md"
    head, _, rest = page.read_text().partition("<!-- table -->")
    _, _, tail = rest.partition("<!-- end of table -->")
    page.write_text(f"{head}<!-- table -->\n" + "\n".join(lines) + f"\n<!-- end of table -->{tail}")
    return f"{sum(r['right'] for r in rows)} of {len(rows)} verdicts right"


if __name__ == "__main__":
    print(main(Path(__file__).resolve().parent))
