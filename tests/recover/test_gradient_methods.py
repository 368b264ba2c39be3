"""Methods that follow the gradient alone: how many steps they take, and when they end."""

import dataclasses

import numpy as np
import pytest
from toy import TRUE, problem, toy_sample

from tissuejax.fitting.gradient_descent import gradient_descent
from tissuejax.recordings.recording import Sample


@pytest.mark.parametrize(("method", "steps"), [("adam", 30), ("lbfgs", 3)])
def test_a_gradient_method_takes_as_many_steps_as_it_says(rng, method, steps):
    p = problem(toy_sample(rng, TRUE), ("energy.a", "energy.rate"))
    p = dataclasses.replace(p, start=p.start | {"energy.a": 20.0, "energy.rate": 0.1})
    taken = []
    ended = gradient_descent(
        p, p.box.free(p.vector(p.start)), method, max_steps=3, tolerance=1e-9, on_accept=lambda n, *_: taken.append(n)
    )
    assert ended.runs == steps
    assert taken[-1] == steps


def test_a_gradient_method_goes_on_while_it_gains_its_share_however_small_the_cost_is(rng):
    """Noise so large that the cost is far below one: what counts is the share that a step gains, not the amount."""
    exact = toy_sample(rng, TRUE, noise=0.0).recordings
    coarse = {
        n: dataclasses.replace(r, channels={k: dataclasses.replace(c, noise_std=3e3) for k, c in r.channels.items()})
        for n, r in exact.items()
    }
    p = problem(Sample("toy", coarse), ("energy.a", "energy.b", "energy.offset"))
    p = dataclasses.replace(p, start=p.start | {"energy.a": 1.0, "energy.b": 300.0, "energy.offset": 60.0})
    y = p.box.free(p.vector(p.start))
    first = 0.5 * float(np.sum(p.residuals(p.start) ** 2))
    ended = gradient_descent(p, y, "lbfgs", max_steps=300, tolerance=1e-6)
    assert first < 0.5
    assert ended.runs > 21
    assert ended.cost < 1e-6 * first
