"""The C force and its guard: the same numbers as Python, limits that hold, bad files refused, examples that compile."""

import shutil
import struct
import subprocess

import numpy as np
import pytest

from tests.surrogate import made
from tissuejax.errors import InputError
from tissuejax.play.guard import Guard
from tissuejax.surrogate.live import compiler, flat
from tissuejax.surrogate.live.ask import Asker

HAS_C = any(shutil.which(name) for name in ("cc", "gcc", "clang"))
needs_c = pytest.mark.skipif(not HAS_C, reason="no C compiler on this machine")


def whole():
    return made.formula(g=(0.2, 0.1), tau=(0.4, 4.0), friction=0.3, strength=150.0)


@needs_c
def test_c_gives_the_numbers_of_python():
    from tissuejax.surrogate.live.native import Native

    t = np.linspace(0, 3, 301)
    d = np.interp(t, [0, 1, 2, 2.6, 3], [-1e-3, 4e-3, 0.0065, -5e-4, -2e-3])
    x = np.interp(t, [0, 1.2, 2.2, 3], [-0.004, -0.004, 0.0104, 0.0104])
    path = np.stack([x, 0.3 * x, made.height(x, 0.3 * x) - d], 1)
    asker, native = Asker(whole()), Native(whole())
    ours = np.array([asker.tick(p, 0.01) for p in path])
    assert abs(ours).max() > 0.1
    assert np.array([native.tick(p, 0.01) for p in path]) == pytest.approx(ours, abs=1e-12)
    native.rest()
    assert not native.tick([np.nan, 0, 0], 0.01).any()


def test_the_guard_limits_force_and_slew_and_ramps_in():
    guard, p = Guard(most=3.0, slew=300.0, ramp=0.5), np.zeros(3)
    told = np.array([guard.safe(p, 0.0, 1e-3, [0, 0, 10.0]) for _ in range(1500)])
    assert np.linalg.norm(told, axis=1).max() <= 3.0 + 1e-12
    assert abs(np.diff(told[:, 2])).max() <= 0.3 + 1e-12
    assert told[99, 2] == pytest.approx(10 * 0.1 / 0.5)  # a fifth of the ramp
    assert told[-1, 2] == pytest.approx(3.0)
    sharp = np.array([guard.safe(p, 0.0, 1e-3, [0, 0, z]) for z in (0.0, 0.0)])
    assert sharp[:, 2] == pytest.approx([2.7, 2.4])


@pytest.mark.parametrize(
    ("p", "age", "force"),
    [
        ([0, 0, 0], 0.011, [0, 0, 1]),
        ([0, 0, np.nan], 0, [0, 0, 1]),
        ([0, 0, 0], 0, [0, np.inf, 1]),
        ([0, 0, 0], np.nan, [0, 0, 1]),
    ],
)
def test_stale_or_bad_positions_give_no_force_and_a_new_ramp(p, age, force):
    guard = Guard(ramp=0.5)
    for _ in range(1000):
        guard.safe(np.zeros(3), 0.0, 1e-3, [0, 0, 1.0])
    assert not guard.safe(np.array(p, float), age, 1e-3, force).any()
    assert guard.safe(np.zeros(3), 0.0, 1e-3, [0, 0, 1.0])[2] < 0.01


GUARDED = """
#define TJ_STATIC
#include "tissuejax_force.h"
int main(void) {
    tj_guard g; double p[3] = {0, 0, 0}, f[3], age, z; int i;
    tj_guard_start(&g, 3.0, 300.0, 0.5);
    for (i = 0; i < 1500; i++) {
        age = i == 700 ? 0.02 : 0; z = i == 900 ? NAN : 10.0;
        f[0] = 0.1; f[1] = 0; f[2] = z; tj_safe(&g, p, age, 1e-3, f); printf("%.17g %.17g\\n", f[0], f[2]);
    }
    (void)tj_open; (void)tj_close; (void)tj_rest; (void)tj_force; (void)tj_box; (void)tj_fault;
    return 0;
}
"""


def built(tmp_path, text, name="test.c"):
    """A C program compiled against the header, warnings being errors."""
    file, program = tmp_path / name, tmp_path / name.split(".")[0]
    file.write_text(text)
    folder = compiler.source("loop.c").parent
    flags = [*compiler.FLAGS, "-Werror", "-D_GNU_SOURCE", "-I", str(folder)]
    subprocess.run([compiler.compiler(), *flags, "-o", str(program), str(file), "-lm"], check=True)
    return program


@needs_c
def test_the_c_guard_is_the_python_guard(tmp_path):
    done = subprocess.run([built(tmp_path, GUARDED)], capture_output=True, text=True, check=True)
    theirs = np.array([line.split() for line in done.stdout.splitlines()], float)
    guard, ours = Guard(3.0, 300.0, 0.5), []
    for i in range(1500):
        force = [0.1, 0.0, np.nan if i == 900 else 10.0]
        ours.append(guard.safe(np.zeros(3), 0.02 if i == 700 else 0.0, 1e-3, force)[[0, 2]])
    assert theirs == pytest.approx(np.array(ours), abs=1e-12)


@needs_c
@pytest.mark.parametrize("name", ["chai3d.c", "openhaptics.c"])
def test_an_example_of_each_kind_runs_with_a_stand_in_for_the_device(tmp_path, name):
    model = flat.write(whole(), tmp_path / "model.tjf")
    text = compiler.source("loop.c").parent.joinpath("examples", name).read_text()
    program = built(tmp_path, text, name)
    done = subprocess.run([program, str(model)], capture_output=True, text=True, check=True)
    rows = np.array([line.split() for line in done.stdout.splitlines()], float)  # x, y, z, fx, fy, fz
    assert len(rows) >= 1000
    deep = made.height(0, 0) - rows[:, 2] > 1e-3
    assert rows[deep][300:, 5].min() > 0.01
    assert not rows[made.height(0, 0) - rows[:, 2] < -5e-4][:, 3:].any()


@needs_c
def test_a_bad_force_file_is_refused(tmp_path):
    text = GUARDED.split("int main")[0] + (
        'int main(int c, char **v) { (void)c; if (tj_open(v[1])) return 0; printf("%s", tj_fault()); return 1; '
        "(void)tj_safe; (void)tj_guard_start; (void)tj_rest; (void)tj_force; (void)tj_box; }"
    )
    program = built(tmp_path, text)
    good = flat.flat(whole())

    def said(content):
        path = tmp_path / "some.tjf"
        path.write_bytes(content)
        done = subprocess.run([program, path], capture_output=True, text=True)
        return done.stdout if done.returncode else "opened"

    assert said(good) == "opened"
    assert said(good[: len(good) // 2]) == "cut off or damaged"
    assert said(b"TJFORCE1" + good[8:]).startswith("not a tissuejax force file")
    assert said(good[:-8] + struct.pack("<d", float("nan"))) == "cut off or damaged"
    assert said(good[:8] + struct.pack("<i", 99) + good[12:]) != "opened"


def test_without_a_compiler_the_loop_is_refused_with_a_word(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setattr(compiler.shutil, "which", lambda name: None)
    with pytest.raises(InputError, match="no C compiler"):
        compiler.compiled("loop.c")
