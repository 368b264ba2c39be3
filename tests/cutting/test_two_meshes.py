"""An estimate taken on to a finer mesh, on a model whose error in h is known by algebra."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from tissuejax.fitting.cut_meshes import on_one_mesh, on_two_meshes
from tissuejax.parameters import Parameter

PATHS = ("energy.a", "energy.b")
A = np.array([[1.0, 0.0], [0.0, 2.0], [1.0, 1.0], [2.0, -1.0]])
TRUTH = np.array([3.0, 2.0])
OFF = -0.12  # relative error of what is predicted on elements of size 1; it falls with the first power of h


@dataclass(frozen=True)
class Mesh:
    """Predicts A (theta (1 + OFF h)): the estimate on it is truth / (1 + OFF h)."""

    h: float
    breaks: bool = False

    class Model:
        parameters = {p: Parameter(p, "Pa", 1.0, lower=0.0) for p in PATHS}

    model = Model()

    def prepared(self, start):
        return self

    def simulated(self, values):
        theta = np.array([values[p] for p in PATHS])
        return {"r": A @ theta * (1 + OFF * self.h) * (np.nan if self.breaks else 1.0)}, {"r": None}


@dataclass(frozen=True)
class Posed:
    predictor: Mesh
    free: tuple = PATHS
    measured: np.ndarray = field(default_factory=lambda: A @ TRUTH)

    def misfit(self, predicted, values):
        return predicted["r"] - self.measured

    def residuals(self, values):
        return self.misfit(self.predictor.simulated(values)[0], values)

    def linearised(self, values):
        return self.residuals(values), A * (1 + OFF * self.predictor.h)


def estimate(h):
    return dict(zip(PATHS, TRUTH / (1 + OFF * h), strict=True))


def test_the_estimate_is_that_of_the_finer_mesh_and_the_shift_what_is_left_of_its_error():
    found = on_two_meshes(Posed(Mesh(1.0)), estimate(1.0), Mesh(0.5), Mesh(1.5))
    assert found.finer
    assert found.predictor.h == 0.5
    for path, fine, true in zip(PATHS, estimate(0.5).values(), TRUTH, strict=True):
        assert found.values[path] == pytest.approx(fine, rel=2e-3)
        left = abs(found.values[path] - true)
        assert found.shift[path] == pytest.approx(left, rel=0.25)  # of first order: the shift is the error left
    np.testing.assert_allclose(found.residuals, 0, atol=0.02)


def test_where_the_finer_mesh_breaks_down_the_coarser_says_how_far_meshes_are_apart():
    posed = Posed(Mesh(1.0))
    found = on_two_meshes(posed, estimate(1.0), Mesh(0.5, breaks=True), Mesh(1.5))
    assert not found.finer
    assert found.values == estimate(1.0)
    apart = (OFF * 0.5) / (1 + OFF)
    for path, value in estimate(1.0).items():
        assert found.shift[path] == pytest.approx(abs(apart) * value)
    alone = on_one_mesh(posed, estimate(1.0))
    assert alone.shift == dict.fromkeys(PATHS, 0.0)
    assert replace(alone, shift=found.shift).predictor is posed.predictor


def test_where_no_other_mesh_runs_the_error_is_not_known():
    found = on_two_meshes(Posed(Mesh(1.0)), estimate(1.0), Mesh(0.5, breaks=True), Mesh(1.5, breaks=True))
    assert found.values == estimate(1.0)
    assert set(found.shift.values()) == {np.inf}
