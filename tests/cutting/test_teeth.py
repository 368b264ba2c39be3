"""Every number of a tooth, and every number in a sentence on a cut's resolution, worked out apart."""

import math
import re

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from tests.cutting.records import record, sample, strokes
from tissuejax.fitting.cut_resolution import plane_modulus, resolution
from tissuejax.fitting.sawtooth import SECTIONS, Settings, sawtooth, sections, strengths

SLANTED = np.array([[0.0, 0.0], [0.003, 0.004], [0.012, 0.012]])
DROPS = np.array([0.0, 3.0, 6.8, 11.6, 17.0, 23.0, 30.0]) * 1e-3


def slanted(depth: float, rate: float = 100.0):
    """Where the edge is, a record whose forces rise to each of the drops, along x and, half as much, down, and the
    force along x."""
    time, tip = strokes(-0.007, 0.021, speed=2e-3, rate=rate)
    x = tip + np.mean(SLANTED[:, 0])
    last = np.clip(np.searchsorted(DROPS, x, side="right") - 1, 0, len(DROPS) - 2)
    phase = (x - DROPS[last]) / np.diff(DROPS)[last]
    low = np.where(last == 0, 0.0, 0.05)  # no jump at the entry, where a filter would ring
    force = np.where(x > 0, low + (0.1 - low) * phase**2, 0.0)
    made = record("r", time, tip, force, depth=depth, thickness=3e-4, **{"blade/profile": SLANTED})
    values = np.array(made.channels["force"].values)
    values[:, 2] = -0.5 * force
    channel = made.channels["force"].__class__(time, values, "N", 0.002)
    made = made.__class__(made.name, made.experiment, made.inputs, {"force": channel}, made.attributes)
    return x, sample(made), force


@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize("depth", [0.003, 0.007])
def test_a_tooth_is_what_its_curve_its_edge_and_its_path_make_of_it(depth, degree):
    x, of, force = slanted(depth)
    settings = Settings(cutoff=20.0, degree=degree)
    found = sawtooth(of.recordings["r"], of.geometry, settings)
    assert found.settings == settings
    assert (found.cutoff, len(found.time)) == (20.0, len(x))
    np.testing.assert_allclose(found.force[:, 1], 0.5 * found.force[:, 0], atol=1e-9)
    middle = np.min(np.abs(x[:, None] - DROPS), axis=1) > 5e-4
    np.testing.assert_allclose(found.force[middle, 0], force[middle], atol=1e-3)
    assert len(found.teeth) == len(found.fits) == 5
    assert [t.at for t in found.teeth] == pytest.approx(DROPS[1:-1], abs=1e-4)
    entered = int(np.argmax(x > 0))
    ends = [entered, *(t.peak for t in found.teeth)]
    height = np.interp(depth, SLANTED[:, 1], SLANTED[:, 0])
    for tooth, curves, before in zip(found.teeth, found.fits, ends, strict=False):
        assert tooth.at == pytest.approx(x[tooth.peak])
        assert tooth.first == before + np.argmin(found.force[before : tooth.peak, 0])
        own = slice(tooth.first, tooth.peak + 1)
        s = np.arange(tooth.peak - tooth.first + 1)
        fitted = [Polynomial.fit(s, found.force[own, i], degree)(s) for i in (0, 1)]
        np.testing.assert_allclose(curves, fitted, atol=1e-10)
        assert tooth.critical == pytest.approx([fitted[0][-1], fitted[1][-1]])
        assert tooth.contact == pytest.approx([depth, height])
        way = np.diff(x[own])
        work = sum(float(np.sum(way * (c[1:] + c[:-1]) / 2)) for c in fitted)
        assert tooth.energy == pytest.approx(work)
        assert tooth.per_area == pytest.approx(work / (way.sum() * depth))
        assert set(tooth.strength) == set(SECTIONS)
        for length, said in tooth.strength.items():
            edge = sections(SLANTED, depth, length)
            assert said == pytest.approx(strengths(tooth.critical, tooth.contact, 3e-4, edge))


def test_forces_on_a_section_are_its_share_of_depth_and_width():
    """A vertical section of a third of the depth, and one at 30 degrees from the vertical of the rest."""
    edge = np.array([[0.002, 0.0, math.pi / 2], [0.004, 0.004 / math.sqrt(3), math.pi / 3]])
    Fx, Fz, b, contact = 0.6, 0.2, 5e-4, (0.006, 0.004 / math.sqrt(3))
    first = Fx / 3 / (0.002 * b), 0.0  # all of it normal
    size = math.hypot(0.004, 0.004 / math.sqrt(3)) * b
    normal = (2 / 3 * Fx * math.sqrt(3) / 2 + Fz / 2) / size
    along = (2 / 3 * Fx / 2 - Fz * math.sqrt(3) / 2) / size
    found = strengths((Fx, Fz), contact, b, edge)
    assert found == pytest.approx((max(first[0], normal), abs(along)))
    flat = strengths((Fx, Fz), (0.002, 0.0), b, edge[:1])  # no width: nothing of the vertical force
    assert flat == pytest.approx((Fx / (0.002 * b), 0.0), abs=1e-9)


@pytest.mark.filterwarnings("ignore:Polyfit may be poorly conditioned")
def test_a_tooth_of_fewer_samples_than_its_curve_needs_is_none():
    """From the first to the peak two more than the degree are the least."""
    _, of, _ = slanted(0.006, rate=10.0)

    def lengths(degree: int) -> list[int]:
        settings = Settings(cutoff=4.0, degree=degree)
        return [t.peak - t.first for t in sawtooth(of.recordings["r"], of.geometry, settings).teeth]

    every = lengths(3)
    shortest = min(every)
    assert lengths(shortest - 2) == every
    assert lengths(shortest - 1) == [n for n in every if n > shortest] != []


def numbers(sentence: str) -> list[float]:
    return [float(x) for x in re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]?\d+)?", sentence)]


def test_every_number_of_every_sentence_on_a_resolution():
    """A strong tissue, a coarse mesh and a thin blade: all there is to say."""
    tau, G, mu, K, b, h = 2e4, 3.0, 1564.0, 2e4, 2e-4, 5e-4
    found = resolution(tau, G, mu, K, b, h, 0.02, 0.005)
    plane = 4 * mu * (K + mu / 3) / (K + 4 * mu / 3)
    length, carried, apart = plane * G / tau**2, math.sqrt(9 * math.pi * plane * G / (32 * 3 * h)), 2 * G / tau
    assert plane_modulus(mu, K) == pytest.approx(plane)
    faces, thin, both, never, numerical = found.sentences
    assert numbers(faces) == pytest.approx(
        [1e3 * length, length / h, 1e3 * h, 3, carried, 1e3 * length / 3], rel=6e-2 if length / h < 1 else 1e-2
    )
    assert numbers(thin) == pytest.approx([1e3 * b, 1e3 * apart, 2 * G / b], rel=1e-3)
    size = 9 * math.pi * plane * G / (32 * 3 * (2 * G / b) ** 2)
    assert numbers(both) == pytest.approx([carried, 2 * G / b, 1e3 * size], rel=5e-3)
    assert never.startswith("not identified: the strength, by any record")
    assert numerical.startswith("not identified on this mesh")
    assert found.as_dict()["cohesive_length"] == found.cohesive_length == pytest.approx(length)
    fine = resolution(4000.0, G, mu, K, 5e-3, 1e-5, 0.02, 0.005)
    assert [s[:14] for s in fine.sentences] == ["not identified"]


def test_a_mesh_that_carries_the_strength_or_a_blade_that_parts_it_leaves_no_contradiction():
    """No strength suits both only where the mesh carries less than the strength, and less than 2 G / b."""
    G, mu, K, h = 3.0, 1564.0, 2e4, 5e-4
    carried = resolution(1e4, G, mu, K, 1e-3, h, 0.02, 0.005).carried

    def said(tau, b):
        return any("suits both" in s for s in resolution(tau, G, mu, K, b, h, 0.02, 0.005).sentences)

    assert said(1.01 * carried, 2 * G / (1.01 * carried))
    assert not said(0.99 * carried, 2 * G / (1.01 * carried))
    assert not said(1.01 * carried, 2 * G / (0.99 * carried))
