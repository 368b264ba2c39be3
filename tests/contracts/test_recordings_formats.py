"""One battery for every recording format found: what must hold for any of them."""

import numpy as np
import pytest

from tests.contracts.recordings_made import recording, sample
from tissuejax.errors import InputError
from tissuejax.recordings import checks, files, inspect
from tissuejax.recordings.recording import Sample
from tissuejax.storage import plain

FORMATS = files.formats()
JUNK = {
    "empty": b"",
    "binary": bytes(range(256)) * 40,
    "text": b"once upon a time\nthere was a liver\n",
    "picture": b"\x89PNG\r\n\x1a\n" + bytes(200),
    "signature only": b"\x89HDF\r\n\x1a\n",
    "gzip head": b"\x1f\x8b\x08\x00junk",
    "zeros": bytes(5000),
}


def test_formats_are_found_by_walking():
    assert len(FORMATS) >= 2


@pytest.mark.parametrize("name", FORMATS)
def test_a_format_says_what_it_is(name):
    kind = FORMATS[name]
    assert kind.name == name
    assert kind.endings
    assert all(e.startswith(".") and e == e.lower() for e in kind.endings)


@pytest.mark.parametrize("junk", JUNK)
@pytest.mark.parametrize("ending", sorted({e for f in FORMATS.values() for e in f.endings} | {".xyz"}))
def test_junk_under_any_ending_is_bad_input(ending, junk, tmp_path):
    path = tmp_path / f"junk{ending}"
    path.write_bytes(JUNK[junk])
    for kind in FORMATS.values():
        assert kind.recognises(path, JUNK[junk][:4096]) in (True, False)
    for attempt in (files.read, files.names, files.read_all):
        with pytest.raises(InputError, match="junk"):
            attempt(path)


def test_content_decides_before_the_ending(tmp_path):
    files.write(sample("uniaxial"), tmp_path / "a.csv")
    assert files.read(tmp_path / "a.csv").name == "s1"


def test_absent_file_and_folder(tmp_path):
    files.write(sample("uniaxial"), tmp_path / "liver.h5")
    with pytest.raises(InputError, match=r"livr.h5: no such file.*liver.h5"):
        files.read(tmp_path / "livr.h5")
    with pytest.raises(InputError, match="found a folder"):
        files.read(tmp_path)


def test_identical_recordings_are_refused_wherever_they_lie(tmp_path):
    files.write(sample("uniaxial"), tmp_path / "a.h5")
    with pytest.raises(InputError, match=r"a.h5: r1.*a.h5: r1.*identical data"):
        files.read_each([tmp_path / "a.h5", tmp_path / "a.h5"])
    one = recording("planar", np.random.default_rng(1))
    with pytest.raises(InputError, match="'x' and 'y'.*identical"):
        checks.distinct({"x": one, "y": one})
    other = files.write(sample("uniaxial", seed=5), tmp_path / "b.h5")
    with pytest.raises(InputError, match="sample named 's1'"):
        files.read_each([tmp_path / "a.h5", other])
    checks.distinct({"x": one, "y": recording("planar", np.random.default_rng(2))})


def test_too_few_values_for_the_parameters():
    made = sample("uniaxial")
    assert checks.enough(made, 6) == 7
    with pytest.raises(InputError, match="7 measured values for 7 free parameters; expected at least 8"):
        checks.enough(made, 7)


@pytest.mark.parametrize("kind", ["uniaxial", "biaxial", "probing", "cutting"])
def test_descriptions_tell_what_is_there(kind, tmp_path):
    files.write(sample(kind), tmp_path / "a.h5")
    (told,) = inspect.describe(tmp_path / "a.h5")["samples"]
    assert plain(told) == told
    (r,) = told["recordings"]
    assert r["experiment"] == kind
    text = "\n".join(inspect.lines(told))
    assert kind in text
    assert "s1" in text
    if kind in ("probing", "cutting"):
        assert "1 hexahedron cells" in text
        assert "of markers is missing" in text


def test_descriptions_measure_ranges():
    r = recording("uniaxial", np.random.default_rng(0))
    told = inspect.describe_recording(r)
    assert told["inputs"]["stretch"]["min"] == r.inputs["stretch"].min()
    assert told["channels"]["nominal_stress"]["max"] == r.channels["nominal_stress"].values.max()
    assert told["duration"] == pytest.approx(np.ptp(r.inputs["time"]))
    twice = Sample("s", {"a": r, "b": r})
    assert "identical" in " ".join(inspect.remarks(twice))
