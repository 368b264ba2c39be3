"""What can't be diagnosed, or only in part, is said in a sentence that tells what to do."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from spring_bench import judged, spring

from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.material import MaterialBench
from tissuejax.energies.catalogue import energy
from tissuejax.errors import InputError, NotConverged
from tissuejax.recordings.recording import Channel, Recording, Sample

QUICK = {"effects": ("drift",), "effort": Effort(most=1)}


def sample(names=("r1", "r2"), n=60, values=None):
    """Small pulls on a neo-Hookean specimen of 500 Pa."""
    rng = np.random.default_rng(3)
    made = {}
    for name in names:
        time = np.arange(n) * 0.1
        stretch = 1 + 0.2 * np.sin(np.pi * np.arange(n) / max(n - 1, 1))
        y = 1000 * (stretch - stretch**-2) + 2 * rng.standard_normal(n) if values is None else values(stretch)
        made[name] = Recording(
            name, "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": Channel(time, y, "Pa", 2.0)}
        )
    return Sample("s", made)


def test_a_file_that_is_no_recording(tmp_path):
    path = tmp_path / "broken.h5"
    path.write_bytes(b"not HDF5")
    with pytest.raises(InputError, match=r"broken\.h5"):
        diagnose(path)
    with pytest.raises(InputError, match="absent"):
        diagnose(tmp_path / "absent.h5")


def test_a_single_recording_says_that_nothing_is_held_out():
    found = diagnose(sample(("r1",)), "neo-hookean", **QUICK)
    assert found.verdict.kind == "nothing-missing"
    assert found.as_dict()["held_out"] == []
    assert any("nothing could be held out" in w for w in found.as_dict()["warnings"])


def test_holding_out_everything_leaves_nothing_to_fit():
    with pytest.raises(InputError, match="leave at least one"):
        diagnose(sample(), "neo-hookean", holdout=["r1", "r2"], **QUICK)


def test_an_unknown_hold_out_is_answered_with_the_known_ones():
    with pytest.raises(InputError, match="r1"):
        diagnose(sample(), "neo-hookean", holdout="r3", **QUICK)


def test_fewer_samples_than_parameters():
    with pytest.raises(InputError, match="3 samples for 3 parameters"):
        diagnose(sample(n=3), "reduced-polynomial-3", **QUICK)
    with pytest.raises(InputError, match="2 samples of nominal_stress; expected at least 3"):
        diagnose(sample(n=2), "neo-hookean", **QUICK)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_values_that_are_not_finite(bad):
    with pytest.raises(InputError, match="r1.*nominal_stress are not finite"):
        diagnose(sample(values=lambda x: np.where(x > 1.1, bad, 1000 * (x - 1))), "neo-hookean", **QUICK)


def test_a_base_model_that_cannot_be_fitted_at_all():
    bench = spring({})
    bench.predict = lambda values, recordings=None: np.full(len(bench.y), np.nan)
    with pytest.raises(NotConverged, match="name another --energy"):
        judged(bench)


def test_parameters_at_which_the_faces_cannot_be_found_are_impossible():
    made = sample()
    bench = MaterialBench.of(made, energy("neo-hookean"), ("r1",), ("r2",), dict.fromkeys(made.recordings, 2.0))

    def stops(*_):
        raise ValueError("A linear solver received non-finite (NaN or inf) input")

    bench._built = {
        key: replace(program, run=SimpleNamespace(compiled=lambda *_: stops)) for key, program in bench._built.items()
    }
    assert np.isnan(bench.predict({"energy.mu": 500.0})).all()

    def fails(*_):
        raise ValueError("another thing")

    bench._built = {
        key: replace(program, run=SimpleNamespace(compiled=lambda *_: fails)) for key, program in bench._built.items()
    }
    with pytest.raises(ValueError, match="another thing"):
        bench.predict({})
