"""One battery for every recording format found: what must hold for any of them."""

import numpy as np
import pytest

from tests.contracts.recordings_made import recording, sample
from tissuejax.errors import InputError
from tissuejax.fitting.setup import split
from tissuejax.recordings import checks, files, remarks
from tissuejax.recordings.recording import Recording, Sample

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


def test_identical_recordings_are_refused():
    one = recording("planar", np.random.default_rng(1))
    with pytest.raises(InputError, match="'x' and 'y'.*identical"):
        checks.distinct([("x", one), ("y", one)])
    checks.distinct([("x", one), ("y", recording("planar", np.random.default_rng(2)))])
    made = Sample("s", {"x": one, "y": one})
    with pytest.raises(InputError, match="identical data"):
        split(made)
    assert split(made, only=("y",)) == (("y",), ())


def test_remarks_tell_what_is_unusual_and_are_silent_otherwise():
    rng = np.random.default_rng(0)
    pull, lost = recording("uniaxial", rng), recording("probing", rng)
    told = " ".join(remarks.remarks(Sample("s", {"a": pull, "b": pull, "c": lost})))
    for words in ("identical", "a: starts at stretch", "c: 8.3% of markers is missing"):
        assert words in told, told
    inputs = dict(pull.inputs) | {"stretch": np.linspace(1, 2, 7)}
    plain = Recording("a", "uniaxial", inputs, pull.channels)
    # nothing but its length is unusual about this one
    assert remarks.remarks(Sample("s", {"a": plain})) == ["a: 7 samples only: too few to tell a model from noise"]
