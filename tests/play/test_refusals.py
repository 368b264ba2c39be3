"""What `precompute` and `play` refuse, typed as a user would: exit code 2 and one sentence that says what to do."""

import json
import re
import socket
import subprocess
import sys

import h5py
import numpy as np
import pytest

from tests.surrogate import made
from tissuejax.cli import main
from tissuejax.errors import NotConverged
from tissuejax.surrogate import ramp, store
from tissuejax.surrogate.live import compiler, direct

TISSUE = ["--energy", "reduced-polynomial-2", "--value", "energy.C10=600", "--value", "energy.C20=300",
          "--value", "volumetric.K=10000"]  # fmt: skip
SLAB = ["--slab", "40x40x14", "--radius", "4", *TISSUE]
SMALL = [*SLAB, "--mesh", "8x8x2", "--depths", "4", "--spacing", "6", "--reach", "3", "--depth", "0.6"]
SOFTER = ["--effect", "softening", "--value", "effects.softening.m=50", "--value", "effects.softening.r=0.3"]


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A small surrogate's file."""
    return store.write(made.small(), tmp_path_factory.mktemp("kept") / "a.play.h5")


def refused(capsys, *argv) -> str:
    """The sentence of a refusal."""
    code = main([*map(str, argv), "--json"])
    out, err = capsys.readouterr()
    said = json.loads(out)
    assert code == said["exit_code"] == 2
    assert "Traceback" not in err
    assert "\n" not in said["error"]
    return said["error"]


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        ([*SLAB, "--depth", "9"], "over 60 % of the thickness at (.*): take --depth 8.4 mm or less"),
        ([*SLAB, "--site", "25,0", "--depth", "5"], "outside the organ; .*choose another --site or a smaller --reach"),
        ([*SLAB, "--site", "12,0", "--reach", "4", "--depth", "5"], "4.0 mm from its rim; places must keep 1.5 probe"),
        ([*SLAB, *SOFTER, "--reach", "3", "--depth", "5"], "softening can't be tabulated: .* --direct"),
        (TISSUE, "which body"),
        (["out/no-such-fit"], "out/no-such-fit: no such file or folder"),
        (["--slab", "40x40x14", *TISSUE], "give --radius in mm"),
        ([*SLAB, "--site", "12;8"], "wanted is X,Y in mm"),
        ([*SLAB, "--mesh", "7x8x2"], "even numbers of at least 8"),
        ([*SLAB, "--depths", "2"], "at least 4"),
        ([*SLAB, "--reach", "nan"], "--reach nan: wanted is a length over 0"),
        ([*SLAB, "--spacing", "0"], "--spacing 0: wanted is a length over 0"),
        ([*SLAB, "--depth", "inf"], "--depth inf: wanted is a length over 0"),
        ([*SLAB, "--site", "1,nan"], "wanted is X,Y in mm"),
        ([*SLAB, "--processes", "0"], "--processes 0"),
        ([*SLAB, "--reach", "3", "--depth", "5", "--error", "0"], "--error 0: wanted is a percentage over 0"),
        ([*SLAB, "--reach", "3", "--depth", "5", "--error", "nan"], "--error nan: wanted is a percentage over 0"),
    ],
)
def test_what_precompute_refuses(argv, words, capsys, tmp_path):
    said = refused(capsys, "precompute", *argv, "--out", tmp_path / "a.play.h5")
    assert re.search(words, said), said
    assert not list(tmp_path.glob("*.h5"))


@pytest.mark.slow
def test_an_error_is_not_called_reached_where_no_force_can_be_felt(capsys, tmp_path):
    """0.6 mm deep there is no force over 0.05 N, so that no error can be told of it: without `--error` that is said."""
    small = [*SMALL, "--processes", "1", "--out", tmp_path / "a.play.h5"]
    said = refused(capsys, "precompute", *small, "--error", "1")
    assert re.search(r"greatest held-out force is 0.0[0-4]\d N, .* over 0.05 N: take a larger --depth", said), said
    assert main([*map(str, ["precompute", *small])]) == 0
    told = capsys.readouterr().out
    assert "0 held-out states over 0.05 N: force not measured" in told
    assert "nan" not in told


def test_a_fit_that_did_not_converge_needs_a_word(capsys, tmp_path):
    energy = {"name": "neo-hookean", "forms": {}, "volumetric": "quadratic"}
    record = {"energy": energy, "effects": [], "parameters": {}, "status": "no convergence after 2 steps"}
    (tmp_path / "result.json").write_text(json.dumps(record))
    slab = ["--slab", "40x40x14", "--radius", "4", "--depth", "9"]
    assert "did not converge (no convergence after 2 steps); fit on, or say --anyway" in refused(
        capsys, "precompute", tmp_path, *slab
    )
    assert "60 %" in refused(capsys, "precompute", tmp_path, *slab, "--anyway")  # one door further


def test_a_site_where_statics_failed_is_told_and_the_others_are_kept(capsys, tmp_path, monkeypatch):
    whole = ramp.ramp

    def failing(*given):
        if list(tmp_path.glob("a.play.h5.sites/*.npz")):
            raise NotConverged("no equilibrium at place (1.0, 2.0) mm, depth 0.60 mm")
        return whole(*given)

    monkeypatch.setattr("tissuejax.surrogate.precompute.ramp", failing)
    said = refused(capsys, "precompute", *SMALL, "--processes", "1", "--out", tmp_path / "a.play.h5")
    assert said.startswith("no equilibrium at place (1.0, 2.0) mm, depth 0.60 mm; ")
    assert "finished sites are kept in " in said
    assert len(list(tmp_path.glob("a.play.h5.sites/*.npz"))) == 1


def test_bad_files_are_refused_when_played(kept, capsys, tmp_path):
    def spoilt(change):
        copy = tmp_path / "b.play.h5"
        copy.write_bytes(kept.read_bytes())
        with h5py.File(copy, "a") as file:
            change(file)
        return refused(capsys, "play", copy)

    assert "version 1, this program reads version" in spoilt(lambda f: f.attrs.__setitem__("version", 1))
    assert "not a number; precompute it again" in spoilt(lambda f: f["depth"].__setitem__((), np.nan))
    cut = tmp_path / "c.play.h5"
    cut.write_bytes(kept.read_bytes()[: kept.stat().st_size // 2])
    assert "damaged or cut off" in refused(capsys, "play", cut)
    assert "make one with `tissuejax precompute`" in refused(capsys, "play", tmp_path / "none.play.h5")
    assert "which FILE?" in refused(capsys, "play")


def test_a_taken_port_is_refused_for_the_page(kept, capsys):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        said = refused(capsys, "play", kept, "--port", port, "--seconds", "5")
    assert f"port {port} can't be opened" in said
    assert "another --port" in said
    assert "--port 99999: wanted is" in refused(capsys, "play", kept, "--port", "99999")
    assert "--seconds -1: wanted is 0 or more" in refused(capsys, "play", kept, "--seconds", "-1")


def test_without_permission_for_real_time_the_loop_runs_and_says_so(kept):
    """The right to it is dropped for good by the process that starts the loop."""
    code = (
        "import ctypes, resource, sys; ctypes.CDLL(None).prctl(24, 23); "  # PR_CAPBSET_DROP, CAP_SYS_NICE
        "resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0)); "
        "from tissuejax.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    words = ["play", str(kept), "--haptics", "none", "--seconds", "0.5"]
    done = subprocess.run([sys.executable, "-c", code, *words, "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    record = json.loads(done.stdout)
    assert not record["real_time"]
    assert record["policy"] == "SCHED_OTHER, not real time: no permission for real-time priority"
    assert record["periods"] == 500


def test_without_a_compiler_the_loop_is_refused_and_the_page_goes_on(kept, capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setattr(compiler.shutil, "which", lambda name: None)
    assert "no C compiler" in refused(capsys, "play", kept, "--haptics", "none", "--seconds", "1")
    assert main(["play", str(kept), "--export", str(tmp_path / "page.html")]) == 0
    assert main(["play", str(kept), "--port", "0", "--seconds", "0.2"]) == 0


def test_a_direct_scene_slower_than_life_is_refused_with_a_mesh_that_would_do(capsys, monkeypatch):
    class Slow:
        def __init__(self, scene, depth):
            self.call = 1e-3

        def pace(self):
            return direct.Pace(0.4, 2.0, 3.0, 1536, 0.1)

    monkeypatch.setattr("tissuejax.commands.play.Direct", Slow)
    said = refused(capsys, "play", "--direct", *SLAB, "--depth", "5", "--mesh", "16x16x6")
    assert "1536 elements run at 0.40 times life here, 1.25 are needed" in said
    assert "take --mesh 12x12x4 or coarser" in said
    assert "over 60 %" in refused(capsys, "play", "--direct", *SLAB, "--depth", "9")
    assert "depth nan mm: wanted is a length" in refused(capsys, "play", "--direct", *SLAB, "--depth", "nan")
    assert "(50.0, 0.0) mm is outside the organ" in refused(capsys, "play", "--direct", *SLAB, "--site", "50,0")
