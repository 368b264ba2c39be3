"""Without a clock nothing that happens in time is a candidate, and what is left refers only to itself."""

import numpy as np

from tissuejax.diagnosis.material import MaterialBench
from tissuejax.diagnosis.untimed import without_clock
from tissuejax.effects.form import Sizes
from tissuejax.energies.catalogue import energy
from tissuejax.recordings.files import read

TABLE = """file = "lab.csv"
sample = "lab"
recording = "{name}"
experiment = "uniaxial"
[columns]
stretch = { column = "stretch" }
nominal_stress = { column = "stress", unit = "Pa" }
"""


def test_a_table_without_time_is_not_asked_for_relaxation_or_drift(tmp_path):
    rows = [f"{n},{l},{(900 + ord(n)) * (l - l**-2)}" for n in "ab" for l in np.linspace(0.8, 1.3, 20)]
    (tmp_path / "lab.csv").write_text("\n".join(["name,stretch,stress", *rows]) + "\n")
    (tmp_path / "lab.toml").write_text(TABLE)
    sample = read(tmp_path / "lab.toml")
    assert not sample.timed
    sizes = Sizes(energy=100.0, strain=0.3, force=1.0, session=60.0, recording=20.0)
    noise = {"a": 5.0, "b": 5.0}
    bench = MaterialBench.of(sample, energy("neo-hookean"), ("a",), ("b",), noise, sizes=sizes)
    kept = without_clock(bench.candidates)
    names = {c.name for c in kept.values()}
    assert not names & {"viscoelasticity", "nonlinear-viscosity", "clock-lag", "periodic", "aging"}
    assert {"energy-form", "slack", "anisotropy", "drift", "compressibility"} <= names
    paths = [p for c in kept.values() for p in (*c.paths, *c.held)]
    assert not [p for p in paths if p.split(".")[2] in ("rate", "settling", "drained", "time")]
    assert all(b in kept for c in kept.values() for b in c.beside)
    assert len({(c.name, c.paths) for c in kept.values()}) == len(kept)


def test_recordings_with_times_keep_all(tmp_path):
    from tests.specimens import every_kind

    assert every_kind().timed
