"""A descent on the spring: shapes leave the values they start from, and what rests on a bound is called so."""

import numpy as np
import pytest
from spring_bench import spring

from tissuejax.diagnosis.bench import Free
from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.refit import Descent, refit


def test_a_shape_moves_though_it_meant_nothing_at_the_start():
    """Relaxation starts at no amplitude, where its time has no slope, and must find both."""
    bench = spring({"relax.g": 0.3, "relax.tau": 0.4})
    misfit = white(bench)
    base = refit(bench, misfit, (), {})
    for tau in (0.1, 5.0):
        found = refit(bench, misfit, ("relax",), {**base.values, "relax.tau": tau})
        assert found.values["relax.tau"] == pytest.approx(0.4, abs=4 * found.std["relax.tau"])
        assert found.chi2 < 1.1 * found.n


@pytest.mark.parametrize("start", [-8.0, -3.0])
def test_a_descent_on_a_curved_valley_reaches_its_floor(start):
    """y = c (exp(a x) - 1) / a from c = 0: the exponent's column is zero at first, and stale after one step."""
    x = np.linspace(-0.2, 0.3, 60)
    y = 700.0 * np.expm1(-17.0 * x) / -17.0

    class Curve:
        free, base = {}, ()
        costly = False
        calls = 0

        def predict(self, values, recordings=None):
            return values["c"] * np.expm1(values["a"] * x) / values["a"] + values["b"] * x

        def jacobian(self, values, paths, recordings=None):
            steps = {p: 1e-6 * max(abs(values[p]), 1.0) for p in paths}
            here = self.predict(values)
            return np.stack([(self.predict({**values, p: values[p] + h}) - here) / h for p, h in steps.items()], 1)

    class Plain:
        def residual(self, prediction, recordings):
            return y - prediction

        def whiten(self, jac, recordings):
            return jac

    spot = spring({})
    bench = Curve()
    bench.free = {p: spot.free["form.c"] for p in ("a", "b", "c")}
    descent = Descent(bench, Plain(), ("a", "b", "c"), ("r",), {})
    end = descent.run(np.array([start, 500.0, 0.0]), 60, 0.1)
    assert end.converged
    assert 2 * end.cost < 0.1
    assert end.y[0] == pytest.approx(-17.0, rel=1e-2)


def test_a_value_is_on_its_bound_only_where_it_is():
    """A range of 0 to 0.95 and a value of a millionth of it: small, and free."""
    bench = spring({})
    descent = Descent(bench, white(bench), ("a", "relax.g"), bench.fitted, {})
    r = np.zeros(bench.mask(bench.fitted).sum())
    assert descent.errors(np.array([10.0, 5e-7]), r)[1] == ()
    assert descent.errors(np.array([10.0, 0.0]), r)[1] == ("relax.g",)


def test_an_angle_beside_an_axis_does_not_hold_up_the_rest():
    """y = a x + 1.05 k x^2 against a x + k cos(t)^2 x^2 from t = 0.001: no angle gives more than k, and a is free."""
    x, k = np.linspace(0.0, 0.4, 60), 1500.0
    y = 2000.0 * x + 1.05 * k * x**2

    class Turned:
        free, base = {"a": Free(0, np.inf, 500, "Pa"), "t": Free(-7, 7, 0.3, "rad")}, ()
        costly = False

        def predict(self, values, recordings=None):
            return values["a"] * x + k * np.cos(values["t"]) ** 2 * x**2

        def jacobian(self, values, paths, recordings=None):
            columns = {"a": x, "t": -k * np.sin(2 * values["t"]) * x**2}
            return np.stack([columns[p] for p in paths], 1)

    class Plain:
        def residual(self, prediction, recordings):
            return y - prediction

        def whiten(self, jac, recordings):
            return jac

    end = Descent(Turned(), Plain(), ("a", "t"), ("r",), {}).run(np.array([1500.0, 1e-3]), 30, 1e-3).y
    expected = 2000.0 + 0.05 * k * np.sum(x**3) / np.sum(x**2)  # least squares of what is left, at cos(t) = 1
    assert end[0] == pytest.approx(expected, rel=1e-4)
    assert np.cos(end[1]) ** 2 == pytest.approx(1.0, abs=1e-3)
