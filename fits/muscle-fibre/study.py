"""Muscle fibre ramps: one ramp time fitted, the other three decades predicted by a Prony series.

tissuejax study fits/muscle-fibre
"""

from pathlib import Path

import tissuejax as tj
from tissuejax.effects.viscoelasticity import Viscoelasticity
from tissuejax.energies.catalogue import energy
from tissuejax.model import Model
from tissuejax.storage import write_json

RAMPS = ("0.1", "1", "10", "100")
STATES = ("Relaxed", "pCa4.4")
TERMS = (1, 2, 3, 4, 5)
SHORTEST, LONGEST = 0.01, 1000.0


def model(terms: int) -> Model:
    """Reduced polynomial of order 2 with `terms` relaxation times, one for each equal part of five decades."""
    return Model(
        energy("reduced-polynomial-2"), None, (Viscoelasticity(terms=terms, shortest=SHORTEST, longest=LONGEST),)
    )


def fitted(sample, terms: int, names: tuple[str, ...], held: tuple[str, ...]):
    """Moduli and shares estimated; times stay where they are, since shares on a fixed grid are a linear problem."""
    made = model(terms)
    times = {path: p.default for path, p in made.parameters.items() if ".tau" in path}
    shares = {path: 0.6 / terms for path in made.parameters if ".g" in path}
    return tj.fit(
        sample,
        made,
        only=names,
        holdout=held,
        unknowns=tj.Unknowns(fix=times, start=shares),
        objective=tj.Objective(weights="relative"),
        search=tj.Search(multistart=3),
    )


def relative(scores, peaks) -> dict[str, float]:
    """RMSE over peak tension, by recording."""
    return {key.split("/")[0]: s.rmse / peaks[key.split("/")[0]] for key, s in scores.items()}


def main(folder: Path) -> str:
    """For each state, number of terms and ramp fitted: the error of the other three; returns the answer."""
    record = {}
    for state in STATES:
        sample = tj.read(f"{folder / 'fibre.toml'}#{state}")
        names = {ramp: next(n for n in sample.recordings if n == f"ramp {ramp} s") for ramp in RAMPS}
        peaks = {n: float(abs(r.channels["nominal_stress"].values).max()) for n, r in sample.recordings.items()}
        entry = {"peak_Pa": peaks, "terms": {}, "from": {}}
        for terms in TERMS:
            found = fitted(sample, terms, (names["0.1"],), tuple(n for r, n in names.items() if r != "0.1"))
            entry["terms"][terms] = {
                "fitted": relative(found.channels, peaks),
                "predicted": relative(found.holdout, peaks),
            }
            if terms == 5:
                tj.write(found, folder / "figures" / f"{state}-from-0.1-s")
        for ramp in RAMPS:
            others = tuple(n for r, n in names.items() if r != ramp)
            found = fitted(sample, 5, (names[ramp],), others)
            entry["from"][ramp] = {
                "fitted": relative(found.channels, peaks),
                "predicted": relative(found.holdout, peaks),
            }
        found = fitted(sample, 5, tuple(names.values()), ())
        entry["joint"] = {
            "fitted": relative(found.channels, peaks),
            "values": {path: [found.values[path], found.std[path]] for path in found.free},
        }
        tj.write(found, folder / "figures" / f"{state}-joint")
        record[state] = entry
    write_json(folder / "result.json", record)
    shown = record["Relaxed"]["terms"][5]["predicted"]
    return "relaxed, five terms fitted to the 0.1 s ramp; error over peak of the others: " + ", ".join(
        f"{name} {100 * error:.0f} %" for name, error in shown.items()
    )


if __name__ == "__main__":
    print(main(Path(__file__).parent))
