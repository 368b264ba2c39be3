"""Campaigns: the same answers whatever the engine, nothing done twice, nothing lost when something is killed."""

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

from tests.cohorts import SETTINGS, STRETCH, cohort
from tests.specimens import recording
from tissuejax.campaign.child import Child
from tissuejax.campaign.cluster import quiet
from tissuejax.campaign.run import begin, go_on, status, table
from tissuejax.campaign.store import Store
from tissuejax.campaign.task import Settings, TooLong, limited
from tissuejax.cli import main
from tissuejax.recordings.hdf5_writing import write
from tissuejax.recordings.recording import Channel, Recording, Sample


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
        first = child.running.process.pid
        assert child.answer("", {"sample": "deaf"}, 0.05, 0.05) is None
        assert child.answer("", {"sample": "dead"}, 30, 0) is None
        assert child.answer("", {"sample": "b"}, 30, 0) == {"sample": "b"}
        assert child.running.process.pid != first
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
