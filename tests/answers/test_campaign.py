"""Campaigns: the same answers whatever the engine, nothing done twice, nothing lost when something is killed."""

import io
import json
import logging
import os
import re
import signal
import subprocess
import sys
import time
from importlib.util import find_spec

import numpy as np
import pytest

import tissuejax as tj
from tests.specimens import recording
from tissuejax.campaign.child import Child
from tissuejax.campaign.dask import quiet
from tissuejax.campaign.run import begin, go_on, status, table
from tissuejax.campaign.store import Store
from tissuejax.campaign.task import Settings, TooLong, limited
from tissuejax.cli import main
from tissuejax.errors import InputError
from tissuejax.fitting.advice import suspect
from tissuejax.progress import Lines
from tissuejax.recordings.hdf5_writing import write
from tissuejax.recordings.recording import Channel, Recording, Sample

STRETCH = np.linspace(1.0, 1.3, 20)
SETTINGS = Settings("fit", "neo-hookean", multistart=1)


def cohort(folder, n=5, bad=True):
    """Files of n specimens of known stiffness, and one that no neo-Hookean fit can take."""
    rng, files = np.random.default_rng(3), []
    time_ = np.arange(20.0)
    for k in range(n):
        made = recording("pull", "uniaxial", time_, STRETCH)
        stress = (1000 + 100 * k) * (STRETCH - STRETCH**-2) + 5 * rng.normal(size=20)
        channel = Channel(time_, stress, "Pa", 5.0)
        file = folder / f"s{k}.h5"
        write(
            Sample(f"s{k}", {"pull": Recording("pull", "uniaxial", made.inputs, {"nominal_stress": channel}, {})}), file
        )
        files.append(str(file))
    if bad:
        twin = Recording("again", "uniaxial", made.inputs, {"nominal_stress": channel}, {})
        first = Recording("pull", "uniaxial", made.inputs, {"nominal_stress": channel}, {})
        write(Sample("twins", {"pull": first, "again": twin}), folder / "twins.h5")
        files.append(str(folder / "twins.h5"))
    return files


def answers(folder):
    store = Store(folder)
    rows = {t.sample: row for t, row in store.rows(store.planned()[0])}
    return {name: {k: v for k, v in row.items() if k not in ("seconds", "worker")} for name, row in rows.items()}


def test_failures_are_rows_and_only_what_is_missing_is_done(tmp_path):
    files = cohort(tmp_path)
    begin(tmp_path / "c", files, SETTINGS)
    told = go_on(tmp_path / "c")
    assert (told["cases"], told["done"], told["failed"], told["missing"]) == (6, 5, 1, 0)
    assert "twins" in told["failures"]
    assert go_on(tmp_path / "c")["ran"] == 0
    rows = {r["sample"]: r for r in table(tmp_path / "c")}
    for k in range(5):
        assert abs(rows[f"s{k}"]["energy.mu"] - (1000 + 100 * k)) < 4 * rows[f"s{k}"]["std energy.mu"]
    store = Store(tmp_path / "c")
    lost = store.planned()[0][2]
    store.path(lost.key).unlink()
    assert go_on(tmp_path / "c")["ran"] == 1
    assert main(["campaign", "report", str(tmp_path / "c")]) == 0
    assert "energy.mu (Pa),std energy.mu (Pa)" in (tmp_path / "c" / "cases.csv").read_text().splitlines()[0]
    begin(tmp_path / "c", files, Settings("fit", "neo-hookean", multistart=1, seed=1))  # other settings, other keys
    assert status(tmp_path / "c")["missing"] == 6
    assert main(["campaign", "report", str(tmp_path / "c"), "--json"]) == 0
    assert (tmp_path / "c" / "cases.csv").read_text().count("\n") == 7


def pull(name, stress):
    """A specimen's pull, its noise said to be 5 Pa."""
    made = recording("pull", "uniaxial", np.arange(20.0), STRETCH)
    channel = Channel(np.arange(20.0), stress, "Pa", 5.0)
    return Sample(name, {"pull": Recording("pull", "uniaxial", made.inputs, {"nominal_stress": channel}, {})})


def test_what_a_fit_would_call_suspect_is_counted_and_said(tmp_path, capsys):
    files = cohort(tmp_path, 2, bad=False)
    stiffening = pull("stiff", 1e5 * (STRETCH - 1) ** 3)
    write(stiffening, tmp_path / "stiff.h5")
    c = str(tmp_path / "c")
    asked = ["--energy", "neo-hookean", "--multistart", "1"]
    assert main(["campaign", "run", c, *files, str(tmp_path / "stiff.h5"), *asked]) == 0
    assert "3 cases: 3 done, 1 of them not to be used as they are (misfit 1), 0 failed" in capsys.readouterr().out
    assert main(["campaign", "report", c, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["suspect"], told["suspect_kinds"], told["usable"]) == (1, {"misfit": 1}, 2)
    rows = {r["sample"]: r for r in table(tmp_path / "c")}
    alone = tj.fit(stiffening, "neo-hookean", search=tj.Search(multistart=1))
    assert rows["stiff"]["suspect"] == "; ".join(suspect(alone)) != ""
    assert rows["s0"]["suspect"] == rows["s1"]["suspect"] == ""
    assert (tmp_path / "c" / "cases.csv").read_text().startswith("sample,status,fit,suspect,")
    page = (tmp_path / "c" / "report.html").read_text()
    assert "not to be used as they are (misfit 1)" in page
    assert "<th>std energy.mu (Pa)</th>" in page
    assert main(["campaign", "run", str(tmp_path / "d"), str(tmp_path / "stiff.h5"), *asked]) == 4
    assert main(["campaign", "report", str(tmp_path / "d")]) == 4
    assert main(["campaign", "status", str(tmp_path / "d")]) == 0


def test_a_fit_of_an_earlier_version_is_not_taken_for_a_good_one(tmp_path):
    store = begin(tmp_path / "c", cohort(tmp_path, 1, bad=False), SETTINGS)
    go_on(tmp_path / "c")
    path = store.path(store.planned()[0][0].key)
    row = json.loads(path.read_text())
    del row["answer"]["suspect"]
    path.write_text(json.dumps(row))
    assert status(tmp_path / "c")["suspect_kinds"] == {"not judged": 1}


def test_a_dead_sensor_is_a_failure_and_not_a_stiffness_of_zero(tmp_path):
    dead = tmp_path / "dead.h5"
    write(pull("dead", np.zeros(20)), dead)
    begin(tmp_path / "c", [*cohort(tmp_path, 1, bad=False), str(dead)], SETTINGS)
    told = go_on(tmp_path / "c")
    assert (told["done"], told["failed"]) == (1, 1)
    with pytest.raises(InputError) as refused:
        tj.fit(dead, "neo-hookean")
    assert told["failures"]["dead"] == str(refused.value)
    assert "zero throughout" in told["failures"]["dead"]


def test_a_file_that_cannot_be_read_is_a_failure_and_the_others_are_done(tmp_path, capsys):
    good = cohort(tmp_path, 2, bad=False)
    (tmp_path / "bad.toml").write_text("this is [ no TOML")
    (tmp_path / "gone.toml").write_text(
        'file = "gone.csv"\nsample = "late"\nrecording = "pull"\nexperiment = "uniaxial"\n[columns]\n'
        'stretch = { column = "stretch" }\nnominal_stress = { column = "stress", unit = "kPa" }\n'
    )
    c, gone = str(tmp_path / "c"), str(tmp_path / "gone.toml")
    files = [gone, str(tmp_path / "bad.toml"), str(tmp_path / "none.h5"), *good]
    asked = ["--energy", "neo-hookean", "--multistart", "1"]
    assert main(["campaign", "run", c, *files, *asked]) == 0
    assert "3 of 5 files can't be read" in capsys.readouterr().err
    told = status(tmp_path / "c")
    assert (told["cases"], told["done"], told["failed"]) == (5, 2, 3)
    assert set(told["failures"]) == {"gone.toml", "bad.toml", "none.h5"}
    with pytest.raises(InputError) as refused:
        tj.read(gone)
    assert told["failures"]["gone.toml"] == str(refused.value)
    rows = [f"{l},{2 * (l - l**-2)}\n" for l in (1, 1.1, 1.2, 1.3, 1.4)]
    (tmp_path / "gone.csv").write_text("stretch,stress\n" + "".join(rows))
    assert main(["campaign", "resume", c, "--failed"]) == 0
    told = status(tmp_path / "c")
    assert (told["cases"], told["done"], told["failed"]) == (5, 3, 2)
    found = {r["sample"]: r for r in table(tmp_path / "c")}
    assert found["late"]["energy.mu"] == pytest.approx(2000, rel=1e-5)


def test_one_bad_sample_of_a_file_leaves_its_others_alone(tmp_path):
    rows = [f"{s},{l},{mu * (l - l**-2)}\n" for s, mu in (("a", 3), ("b", 5)) for l in (1, 1.1, 1.2, 1.3, 1.4)]
    (tmp_path / "lab.csv").write_text("specimen,stretch,stress\n" + "".join(rows) + "c,-1,0\nc,-2,0\n")
    (tmp_path / "lab.toml").write_text(
        'file = "lab.csv"\nsample = "{specimen}"\nrecording = "pull"\nexperiment = "uniaxial"\n[columns]\n'
        'stretch = { column = "stretch" }\nnominal_stress = { column = "stress", unit = "kPa" }\n'
    )
    begin(tmp_path / "c", [str(tmp_path / "lab.toml")], SETTINGS)
    told = go_on(tmp_path / "c")
    assert (told["done"], list(told["failures"])) == (2, ["c"])
    assert go_on(tmp_path / "c", failed=True)["cases"] == 3


def test_a_selection_that_picks_nothing_is_refused(tmp_path, capsys):
    (good,), c = cohort(tmp_path, 1, bad=False), str(tmp_path / "c")
    for wrong in (f"{tmp_path}/day*.toml", f"{good}#s7"):
        assert main(["campaign", "run", c, good, wrong, "--energy", "neo-hookean"]) == 2
    assert "unknown sample 's7'" in capsys.readouterr().err
    lost = [str(tmp_path / name) for name in ("x.h5", "y.h5")]
    assert main(["campaign", "run", c, *lost, "--energy", "neo-hookean"]) == 2
    assert "none of the 2 files can be read; the first: " in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_progress_has_one_count(tmp_path):
    begin(tmp_path / "c", cohort(tmp_path, 3, bad=False), SETTINGS)
    store = Store(tmp_path / "c")
    store.work(store.planned()[0][0])
    said = io.StringIO()
    go_on(tmp_path / "c", progress=Lines(every=0.0, file=said))
    lines = [line.split("] ")[1] for line in said.getvalue().splitlines()]
    assert lines == ["cases (1 done before) 1 of 2: s1", "cases (1 done before) 2 of 2: s2"]


def test_a_changed_recording_is_another_case(tmp_path):
    files = cohort(tmp_path, 2, bad=False)
    begin(tmp_path / "c", files, SETTINGS)
    before = {t.sample: t.key for t in Store(tmp_path / "c").planned()[0]}
    cohort(tmp_path, 1, bad=False)
    made = recording("pull", "uniaxial", np.arange(20.0), STRETCH)
    channel = Channel(np.arange(20.0), 1200 * (STRETCH - STRETCH**-2), "Pa", 5.0)
    write(Sample("s1", {"pull": Recording("pull", "uniaxial", made.inputs, {"nominal_stress": channel}, {})}), files[1])
    begin(tmp_path / "c", files, SETTINGS)
    after = {t.sample: t.key for t in Store(tmp_path / "c").planned()[0]}
    assert before["s0"] == after["s0"]
    assert before["s1"] != after["s1"]


def test_a_case_that_takes_its_worker_along_is_given_up(tmp_path):
    store = begin(tmp_path / "c", cohort(tmp_path, 2, bad=False), SETTINGS, retries=1)
    first = store.planned()[0][0]
    (tmp_path / "c" / "running").mkdir(parents=True)
    (tmp_path / "c" / "running" / first.key).write_text("2")
    told = go_on(tmp_path / "c")
    assert (told["done"], told["failed"]) == (1, 1)
    assert "worker died" in told["failures"]["s0"]


def test_the_limit_rings():
    with pytest.raises(TooLong), limited(0.05):
        time.sleep(2)
    with limited(0.05):
        pass
    time.sleep(0.1)


def test_a_problem_file_asks_it_of_every_sample(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    rows = [f"{s},{l},{mu * (l - l**-2)}\n" for s, mu in (("a", 3), ("b", 5)) for l in (1, 1.1, 1.2, 1.3, 1.4)]
    (tmp_path / "lab.csv").write_text("specimen,stretch,stress\n" + "".join(rows))
    (tmp_path / "lab.toml").write_text(
        'file = "lab.csv"\nsample = "{specimen}"\nrecording = "pull"\nexperiment = "uniaxial"\n[columns]\n'
        'stretch = { column = "stretch" }\nnominal_stress = { column = "stress", unit = "kPa" }\n'
    )
    (tmp_path / "lab.yaml").write_text(
        "format: tissuejax-problem-1\nspecimen: lab.toml\nmodel: {energy: mooney-rivlin}\n"
        "parameters: {energy.C01: {fixed: 0}, energy.C10: {bounds: [100 Pa, null]}}\n"
        "options: {multistart: 1}\nout: out/lab\n"
    )
    assert main(["campaign", "run", "lab.yaml"]) == 0
    capsys.readouterr()
    assert main(["campaign", "status", "lab.yaml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["done"] == 2
    rows = {r["sample"]: r for r in table(tmp_path / "out/lab/campaign")}
    assert rows["a"]["energy.C10"] == pytest.approx(1500, rel=1e-5)
    assert rows["b"]["energy.C10"] == pytest.approx(2500, rel=1e-5)
    assert "energy.C01" not in rows["a"]
    settings = Store(tmp_path / "out/lab/campaign").planned()[0][0].settings
    assert dict(settings.fit)["bounds"] == (("energy.C10", 100.0, "inf"),)
    assert main(["campaign", "run", "c", "lab.toml", "--energy", "gent", "--fix", "energy.C01=0"]) == 2


def sleeping(folder, task):
    """A case that answers, dies, or does not listen to its alarm."""
    if task["sample"] == "dead":
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(60 if task["sample"] == "deaf" else 0)
    return {"sample": task["sample"]}


def test_a_case_that_does_not_stop_is_killed_and_the_next_one_runs():
    child = Child(sleeping)
    try:
        assert child.answer("", {"sample": "a"}, 30, 0) == {"sample": "a"}
        first = child.process.pid
        assert child.answer("", {"sample": "deaf"}, 0.05, 0.05) is None
        assert child.answer("", {"sample": "dead"}, 30, 0) is None
        assert child.answer("", {"sample": "b"}, 30, 0) == {"sample": "b"}
        assert child.process.pid != first
    finally:
        child.end()


@pytest.mark.slow
def test_the_limit_holds_under_dask(tmp_path):
    pytest.importorskip("distributed")
    begin(tmp_path / "c", cohort(tmp_path, 2, bad=False), SETTINGS, limit=0.001)
    told = go_on(tmp_path / "c", "dask", 1)
    assert told["failed"] == 2
    assert set(told["failures"].values()) == {"took longer than 0.001 s"}


@pytest.mark.slow
def test_a_scheduler_that_dies_loses_nothing_that_was_finished(tmp_path):
    pytest.importorskip("distributed")
    begin(tmp_path / "c", cohort(tmp_path, 40, bad=False), SETTINGS, retries=2)
    where = tmp_path / "scheduler.json"
    run = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard"]
    scheduler = subprocess.Popen([*run, "--scheduler-file", str(where)], start_new_session=True)
    run = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    worker = subprocess.Popen([*run, "--scheduler-file", str(where), "--death-timeout", "20"], start_new_session=True)
    try:
        while not where.exists() or not where.read_text().strip().endswith("}"):
            time.sleep(0.2)
        address = json.loads(where.read_text())["address"]
        script = (
            "from tissuejax.cli import main\nimport sys\nif __name__ == '__main__':\n"
            f"    sys.exit(main(['campaign', 'resume', {str(tmp_path / 'c')!r}, '--engine', 'dask', '--scheduler', "
            f"{address!r}]))\n"
        )
        (tmp_path / "go.py").write_text(script)
        client = subprocess.Popen([sys.executable, str(tmp_path / "go.py")], stderr=subprocess.PIPE, text=True)
        results, begun = tmp_path / "c" / "results", time.monotonic()
        while len(list(results.rglob("*.json"))) < 3:
            assert time.monotonic() - begun < 300
            time.sleep(0.05)
        scheduler.kill()
        _, said = client.communicate(timeout=300)
        assert client.returncode == 3
        assert "campaign resume" in said
        assert "Traceback" not in said
        assert "distributed." not in said
    finally:
        for process in (scheduler, worker):
            process.kill()
            process.wait()
    there = status(tmp_path / "c")["done"]
    assert there >= 3
    assert len(list((tmp_path / "c" / "running").iterdir())) <= 1
    told = go_on(tmp_path / "c")
    assert told["ran"] == 40 - there
    assert told["done"] == 40


def test_the_help_says_which_options_are_for_which_action(capsys):
    with pytest.raises(SystemExit):
        main(["campaign", "status", "--help"])
    parts = re.split(r"^for (.*):$", capsys.readouterr().out, flags=re.M)[1:]
    options = {verbs: set(re.findall(r"^  (--[a-z-]+)", text, re.M)) for verbs, text in zip(*[iter(parts)] * 2)}
    assert {"--energy", "--fix", "--limit"} <= options["run"]
    assert options["run and resume"] == {"--engine", "--workers", "--scheduler", "--failed"}
    assert options["population"] == {"--group"}
    assert options["status and report"] == set()


def test_dasks_own_log_is_quiet_while_it_works_and_as_before_afterwards():
    log = logging.getLogger("distributed.client")
    level = log.level
    with quiet():
        assert not log.isEnabledFor(logging.CRITICAL)
        assert logging.getLogger("tissuejax").isEnabledFor(logging.ERROR)
    assert log.level == level


@pytest.mark.slow
def test_ctrl_c_ends_a_campaign_under_dask_in_one_line(tmp_path):
    pytest.importorskip("distributed")
    begin(tmp_path / "c", cohort(tmp_path, 200, bad=False), SETTINGS)
    run = [sys.executable, "-m", "tissuejax", "campaign", "resume", str(tmp_path / "c"), "--engine", "dask"]
    client = subprocess.Popen(run, start_new_session=True, stderr=subprocess.PIPE, text=True)
    begun = time.monotonic()
    while not list((tmp_path / "c" / "results").rglob("*.json")):
        assert time.monotonic() - begun < 300
        time.sleep(0.05)
    os.killpg(client.pid, signal.SIGINT)  # as a terminal does: workers are in the group
    _, said = client.communicate(timeout=60)
    assert client.returncode == 130
    lines = [line for line in said.splitlines() if not line.startswith("[")]  # "[  12 s] cases 1 of 200": progress
    assert len(lines) == 1
    assert "goes on with the rest" in lines[0]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["processes", "dask"])
def test_engines_give_the_same_bits(tmp_path, engine):
    if engine == "dask" and find_spec("distributed") is None:
        pytest.skip("the extra `cluster` is not installed")
    files = cohort(tmp_path, 3)
    for name in ("serial", engine):
        begin(tmp_path / name, files, SETTINGS)
        go_on(tmp_path / name, name, 2)
    assert json.dumps(answers(tmp_path / "serial"), sort_keys=True) == json.dumps(
        answers(tmp_path / engine), sort_keys=True
    )


def _lives(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.slow
@pytest.mark.parametrize("whom", ["worker", "client"])
def test_killing_loses_no_more_than_what_was_under_way(tmp_path, whom):
    files = cohort(tmp_path, 40, bad=False)
    begin(tmp_path / "c", files, SETTINGS, retries=2)
    go = f"go_on({str(tmp_path / 'c')!r}, 'processes', 1)"
    script = f"from tissuejax.campaign.run import go_on\nif __name__ == '__main__':\n    {go}\n"
    (tmp_path / "go.py").write_text(script)
    client = subprocess.Popen([sys.executable, str(tmp_path / "go.py")], start_new_session=True)
    results = tmp_path / "c" / "results"
    begun = time.monotonic()
    while len(list(results.rglob("*.json"))) < 3:
        assert time.monotonic() - begun < 300
        time.sleep(0.05)
    if whom == "worker":
        row = json.loads(next(results.rglob("*.json")).read_text())
        os.kill(row["worker"], signal.SIGKILL)
        assert client.wait(300) == 0
        assert status(tmp_path / "c")["done"] == 40
    else:
        worker = json.loads(next(results.rglob("*.json")).read_text())["worker"]
        os.kill(client.pid, signal.SIGKILL)  # the client alone: its worker has to notice
        client.wait()
        while _lives(worker):
            assert time.monotonic() - begun < 300, "the worker outlived its client"
            time.sleep(0.05)
        there = status(tmp_path / "c")["done"]
        assert len(list((tmp_path / "c" / "running").iterdir())) <= 1
        told = go_on(tmp_path / "c")
        assert told["ran"] == 40 - there
        assert told["done"] == 40
