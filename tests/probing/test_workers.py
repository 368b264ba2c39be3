"""A second process gives what this one gives, and its errors come back."""

import os
import signal
import threading
import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.experiments import programs, workers


def test_results_come_back_in_order_and_equal():
    x = [np.arange(4.0) + i for i in range(5)]
    jobs = [(_square, 3, a) for a in x]
    out = workers.run_all(jobs, 2)
    assert all(np.allclose(o, 3 * a**2) for o, a in zip(out, x))
    assert np.allclose(programs.run(_square, 3, x[1]), out[1])


def test_helpers_are_given_back_and_new_ones_serve():
    x = np.arange(12.0).reshape(4, 3)
    jobs = [(_square, 3, row) for row in x]
    workers.run_all(jobs, 2)
    processes = [w.process for w in workers._workers]
    workers.release()
    assert processes
    assert all(p.poll() is not None for p in processes)
    assert np.allclose(workers.run_all(jobs, 2), 3 * x**2)


def test_a_failing_job_raises_here():
    with pytest.raises(ValueError, match="no such thing"):
        workers.run_all([(_fails, 0, np.zeros(2))] * 3, 2)


def test_what_is_stopped_in_the_middle_leaves_no_late_answer():
    job = (_square, 3, np.ones(2))
    workers.run_all([job] * 3, 2)  # a helper is there
    at_work = workers._workers[0].process
    with pytest.raises(KeyboardInterrupt):
        workers.run_all([job] * 3, 2, _stopped_here)
    assert at_work.wait(timeout=10) != 0
    assert np.allclose(workers.run_all([job] * 3, 2), 3.0)


def test_a_worker_leaves_ctrl_c_to_its_caller_and_ends_with_it_in_the_middle_of_a_job():
    worker = workers.Worker()
    assert worker.ask((_square, 3, np.ones(2)), programs.run).tolist() == [3.0, 3.0]
    worker.process.send_signal(signal.SIGINT)
    assert worker.ask((_square, 2, np.ones(2)), programs.run).tolist() == [2.0, 2.0]
    told = []
    asking = threading.Thread(target=_asked, args=(worker, told), daemon=True)
    asking.start()
    time.sleep(0.5)
    worker.close()
    assert worker.process.poll() is not None
    asking.join(timeout=10)
    assert told == ["lost"]  # the job of a minute was not waited for


def test_programs_are_compiled_ahead_on_both_sides():
    x = [np.arange(6.0), np.arange(7.0)]
    jobs = [(_square, 5, a) for a in x]
    assert workers.run_all(jobs, 2, programs.compiled) == [None, None]
    assert workers.run_all(jobs, 1, programs.compiled) == [None, None]
    known = len(programs._compiled)
    assert all(np.allclose(o, 5 * a**2) for o, a in zip(workers.run_all(jobs, 2), x, strict=True))
    assert len(programs._compiled) == known


def test_inside_a_transformation_a_program_is_a_function():
    assert jax.grad(lambda x: programs.run(_square, 2, x).sum())(jnp.ones(3)).tolist() == [4.0, 4.0, 4.0]


def _square(static, x):
    return static * x**2


def _stopped_here(function, static, x):
    if workers.CODE not in os.environ:  # here, and not in a helper
        time.sleep(0.5)  # a helper has begun
        raise KeyboardInterrupt
    time.sleep(1.0)
    return np.zeros(2)


def _slow(job):
    time.sleep(60)


def _asked(worker, told):
    try:
        told.append(worker.ask((0,), _slow))
    except (EOFError, OSError):
        told.append("lost")


def _fails(static, x):
    raise ValueError("no such thing")
