"""p01 to p04, probings from another simulator with one effect concealed or none: is it named, where, and how large?

tissuejax study fits/probing-diagnosis
"""

import json
import os
import tempfile
import time
from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.cache.source import content
from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.errors import InputError
from tissuejax.progress import for_terminal
from tissuejax.report.page import write_figures
from tissuejax.storage import write_json

CASES = ("p01", "p02", "p03", "p04")
NAMES = {
    "viscoelasticity": "viscoelasticity",
    "breathing": "support-motion",
    "stiff inclusion": "inclusion",
}  # key: ours


def main(folder: Path) -> str:
    """Diagnose each case, compare with its key, write result.json and the figures; goes on where this code stopped."""
    practice = Path(os.environ.get("TISSUEJAX_SHARED", folder.resolve().parents[2] / "shared")) / "practice"
    if not (practice / "p01.h5").exists():
        raise InputError(f"{practice / 'p01.h5'} is not here: set TISSUEJAX_SHARED to the folder that holds practice/")
    keys = json.loads((practice / "keys-probing.json").read_text())
    done = folder / "result.json"
    before = json.loads(done.read_text()) if done.exists() else {}
    code = content()
    records = before["cases"] if code and before.get("code") == code else {}
    for name in CASES:
        if name in records:
            continue
        begun = time.perf_counter()
        out = Path(tempfile.gettempdir()) / "probing-diagnosis" / name
        found = diagnose(tj.read(practice / f"{name}.h5"), "reduced-polynomial-2", out=out, progress=for_terminal())
        records[name] = compared(found, keys[name]) | {"seconds": time.perf_counter() - begun}
        write_figures(found, folder / "figures" / name)
        write_json(done, {"code": code, "cases": records})
    right = sum(r["right"] for r in records.values())
    return f"{right} of {len(records)} right: " + "; ".join(f"{n} {r['told']}" for n, r in records.items())


def compared(found: Diagnosis, key: dict) -> dict:
    """What a diagnosis said beside its key."""
    record = found.as_dict()
    named = [e["name"] for e in record["effects"]]
    wanted = [NAMES[e] for e in key["effects"]]
    told = record["verdict"] if not named else f"{record['verdict']} {', '.join(named)}"
    values = {p: v for e in record["effects"] for p, v in e["parameters"].items()}
    kept = (
        "verdict",
        "confidence",
        "effects",
        "located",
        "before",
        "after",
        "base_parameters",
        "numerical_error",
        "sets",
    )
    return {
        "right": named == wanted and record["verdict"] in ("found", "nothing-missing"),
        "told": told,
        "runs": found.search.bench.runs.count,
        "against_key": against(values, key),
        **{name: record[name] for name in kept},
    }


def against(values: dict, key: dict) -> dict:
    """Numbers of the key and of the diagnosis side by side, SI."""
    value = {p.removeprefix("effects."): v["value"] for p, v in values.items()}
    given = key["parameters"]
    if "visco" in given:
        return {
            "true": given["visco"],
            "found": {k: [value.get(f"viscoelasticity.{k}{i}") for i in (1, 2)] for k in ("g", "tau")},
        }
    if "breathing" in given:
        waves = {w: [value[f"support-motion.{w}.{r}"] for r in ("r1", "r2")] for w in ("sin", "cos", "sin2", "cos2")}
        first, second = np.hypot(waves["sin"], waves["cos"]), np.hypot(waves["sin2"], waves["cos2"])  # r3 is held out
        breath = given["breathing"]
        return {
            "true": {"amplitude": breath["amp"], "second": breath["amp2"], "period": breath["period"]},
            "found": {"amplitude": first, "second": second, "period": 1 / value["support-motion.frequency"]},
        }
    if "inclusion" in given:
        place = [value[f"inclusion.{c}"] for c in "xyz"]
        true = given["inclusion"]
        return {
            "true": {k: true[k] for k in ("centre", "semi_axes", "factor")},
            "found": {
                "centre": place,
                "radius": value["inclusion.radius"],
                "factor": np.exp(value["inclusion.contrast"]),
            },
            "off_by": np.linalg.norm(np.array(place) - true["centre"]),
        }
    return {}


if __name__ == "__main__":
    print(main(Path(__file__).parent))
