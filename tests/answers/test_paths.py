"""`simulate` takes a path as a lab has it: units in the names of the columns, or a recording that is there."""

from types import SimpleNamespace

import numpy as np
import pytest

from tissuejax.commands.simulating import _probing, table
from tissuejax.errors import InputError
from tissuejax.experiments.virtual import probing
from tissuejax.recordings.recording import Sample


def test_units_in_the_names_are_read(tmp_path):
    path = tmp_path / "probe.csv"
    path.write_text("time (ms);x (mm);y (mm);z (mm)\n0;1;2;30\n500;1;2;25\n")
    time, places = table(str(path), "probe position", "m")
    np.testing.assert_allclose(time, [0, 0.5])
    np.testing.assert_allclose(places, [[1e-3, 2e-3, 30e-3], [1e-3, 2e-3, 25e-3]])


def test_without_units_it_is_si(tmp_path):
    path = tmp_path / "path.csv"
    path.write_text("time,stretch\n0,1\n10,1.3\n")
    time, stretch = table(str(path), "stretch", "1")
    np.testing.assert_allclose([time, stretch], [[0, 10], [1, 1.3]])


@pytest.mark.parametrize("text", ["0,1\n10,1.3\n", "time,stretch\n0,1\n", "time,stretch\n0,1\n1,\n"])
def test_what_is_no_path_is_refused(text, tmp_path):
    (tmp_path / "path.csv").write_text(text)
    with pytest.raises(InputError, match="wanted are"):
        table(str(tmp_path / "path.csv"), "stretch", "1")


def test_a_recording_of_the_body_is_a_path():
    time, centre = np.array([0.0, 1.0]), np.array([[0, 0, 30e-3], [0, 0, 25e-3]])
    body = Sample("s", {"press": probing("press", time, centre, 8e-3)})
    made = _probing(body, SimpleNamespace(path="press", radius=None, body="s.h5"))
    np.testing.assert_allclose(made.inputs["probe/position"], centre)
    assert made.attributes["probe/radius"] == 8e-3
    with pytest.raises(InputError, match="there: press"):
        _probing(body, SimpleNamespace(path="pres", radius="8 mm", body="s.h5"))
