"""Single-line faults that a sceptical reading found the tests blind to, each with the test that now notices it.

    python tests/mutation/faults.py [WORDS OF A FAULT]

Each fault is put into a copy of the last commit, which is removed afterwards, and its test is run there; nothing of the
working tree is touched. Prints "caught" or "SURVIVED" and ends with exit code 1 if any survived. A fault whose line is
no longer in the code stops the program: then the list is to be brought up to date.

Three faults of the reading have no line any more, since what they sat in was deleted: the held-out term of the search's
criterion, its rule on held-out recordings, and the mark of kept refits.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent


class Fault(NamedTuple):
    """What is wrong, where, and the test that says so."""

    name: str
    module: str
    right: str
    wrong: str
    test: str


FIT, LEVEL = "tests/recover/test_least_squares.py", "tests/estimation/test_level.py"
LIKELIHOOD = "tests/estimation/test_correlation.py -k 'likelihood_is_that'"
WALK = "        aa = aa + 2 * dt * ab + dt**2 * bb + walk"
FAULTS = (
    Fault("cache: contents of files left out of the key", "cache/source.py",
          'len(content)}\\n".encode() + content)', 'len(content)}\\n".encode())',
          "tests/test_cache.py -k hash_is_of_names_and_contents"),
    Fault("cache: double precision left out of the key", "cache/key.py",
          "(c.jax_enable_x64, c.jax_debug_nans", "(c.jax_debug_nans", "tests/test_cache.py -k settings_are_part"),
    Fault("cache: shapes left out of the key", "cache/programs.py",
          "(x.shape, x.dtype) for x", "(x.dtype,) for x", "tests/test_cache.py -k text_or_shape"),
    Fault("errors: widening not squared in the covariance", "estimation/covariance.py",
          "(found.u))) * widening**2", "(found.u))) * widening", f"{FIT} -k widening_goes"),
    Fault("errors: a misfit beyond the noise does not widen", "fitting/least_squares.py",
          "return (1.0, np.inf) if known else", "return (1.0, np.inf) if True else", f"{FIT} -k widening_goes"),
    Fault("errors: n + p degrees of freedom", "fitting/least_squares.py",
          "max(len(r) - float(np.sum(u", "max(len(r) + float(np.sum(u", f"{FIT} -k student"),
    Fault("profile: threshold of 90 % for 95", "fitting/profile.py",
          "threshold = spread.quantile() ** 2", "threshold = 2.706", f"{FIT} -k profile_agrees"),
    Fault("noise of a group: n + p", "fitting/least_squares.py",
          "max(1.0, len(mine) - taken)", "max(1.0, len(mine) + taken)", f"{FIT} -k estimated_level_is_unbiased"),
    Fault("advice: serial factor (1 + r)(1 - r)", "fitting/advice.py",
          "math.sqrt((1 + rho) / (1 - rho))", "math.sqrt((1 + rho) * (1 - rho))", f"{FIT} -k what_is_said_of"),
    Fault("diagnosis: standard errors not inflated by the misfit", "estimation/covariance.py",
          "return max(scale, 1e-12), float(dof)", "return 1.0, float(dof)", "tests/diagnosis/test_intervals.py"),
    Fault("score: columns not projected", "diagnosis/score.py",
          "columns = columns - basis @ (basis.T @ columns)", "columns = columns - 0 * basis @ (basis.T @ columns)",
          "tests/diagnosis/test_engine.py -k 'gain_of_a_linear_refit'"),
    Fault("noise: the mismatch falls as f^-2, low-pass of first order", "estimation/correlation.py",
          f"share * (1 - fade**2)\n{WALK} * dt**3 / 3", f"share * (1 - fade**2)\n{WALK} * dt", LIKELIHOOD),
    Fault("noise: the mismatch falls as f^-2, low-pass of second order", "estimation/correlation.py",
          f"        )\n{WALK} * dt**3 / 3", f"        )\n{WALK} * dt", LIKELIHOOD),
    Fault("noise not recorded: median times 0.6745", "estimation/level.py",
          "np.median(np.abs(d)) / 0.6745", "np.median(np.abs(d)) * 0.6745", f"{LEVEL} -k neighbours_alone"),
    Fault("step: relaxation on the simulated clock", "tled/step.py",
          "h, real = clock.step, clock.step * clock.compression", "h, real = clock.step, clock.step",
          "tests/tled/test_laws.py -k relaxation"),
)  # fmt: skip


def caught(fault: Fault) -> tuple[bool, int]:
    """Whether the test fails with the fault and passes without it, in the working directory, and its exit code."""
    path = Path("tissuejax", fault.module)
    text = path.read_text()
    if text.count(fault.right) != 1:
        raise SystemExit(f"{fault.name}: {path} has {text.count(fault.right)} times {fault.right!r}, wanted is once")
    passed = []
    for content in (text.replace(fault.right, fault.wrong), text):
        path.write_text(content)
        command = f"{sys.executable} -m pytest -x -q -p no:cacheprovider {fault.test}"
        passed.append(subprocess.run(command, shell=True, stdout=subprocess.DEVNULL, check=False).returncode)
    if passed[1] != 0:
        raise SystemExit(f"{fault.name}: {fault.test} fails without the fault")
    return passed[0] == 1, passed[0]


def main(words: str = "") -> int:
    """Try them all; how many survived."""
    survived = 0
    with tempfile.TemporaryDirectory() as name:
        copy = Path(name) / "copy"
        subprocess.run(["git", "-C", HERE, "worktree", "add", "-q", "--detach", copy, "HEAD"], check=True)
        try:
            os.chdir(copy)
            os.environ |= {"PYTHONPATH": str(copy), "TISSUEJAX_CACHE": "off", "PYTHONDONTWRITEBYTECODE": "1"}
            for fault in FAULTS:
                if words in fault.name:
                    found, code = caught(fault)
                    survived += not found
                    said = "caught" if found else "SURVIVED"
                    print(f"{said:<9} {fault.name}  [{fault.test}, exit code {code}]", flush=True)
        finally:
            os.chdir(HERE)
            subprocess.run(["git", "-C", HERE, "worktree", "remove", "--force", copy], check=True)
    return survived


if __name__ == "__main__":
    sys.exit(1 if main(*sys.argv[1:]) else 0)
