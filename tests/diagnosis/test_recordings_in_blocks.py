"""What the discrepancy is told of several recordings: stresses and strains of their own, clocks of the session."""

from dataclasses import replace

import numpy as np
import pytest
from straight_bench import DRIVE, TIME, N, straight

from tissuejax.diagnosis.judgement.blocks import State, blocks, driven_states, path, series, strain
from tissuejax.diagnosis.judgement.particular import Means
from tissuejax.estimation.series import Segment

NAMES, PEAKS = ("q", "p", "r", "p"), (3.0, 1.0, 5.0, 7.0)


def made():
    """Four segments of three recordings, each of a constant stress, of stretch but for the last."""
    bench = straight({})
    drives = [np.exp(DRIVE[:N]), 1 + DRIVE[:N], 2 - DRIVE[:N], DRIVE[N:]]
    bench.segments = [
        Segment(
            name, "force", f"c{i}", slice(i * N, (i + 1) * N), TIME, "N", drive, "stretch" if i < 3 else "shear", "1"
        )
        for i, (name, drive) in enumerate(zip(NAMES, drives, strict=True))
    ]
    bench.y = np.repeat(np.array(PEAKS) * [1, -1, 1, -1], N)
    return bench


def test_stresses_are_over_the_largest_of_their_own_recording():
    bench = made()
    cut = blocks(bench, {"force": 6})
    found = series(bench, cut, driven_states(bench), means=Means(peak=1.0), starts={"p": 40.0})
    assert [s.recording for s in found] == list(NAMES)
    assert [s.peak for s in found] == [3.0, 7.0, 5.0, 7.0]
    assert [s.start for s in found] == [0.0, 40.0, 0.0, 40.0]
    for k, s in enumerate(found):
        rows = np.split(TIME, cut.starts[cut.owner == k][1:] - k * N)
        np.testing.assert_allclose(s.time, [np.mean(r) for r in rows])


def test_strains_are_all_that_are_driven_in_the_recording():
    """One beside the other in the order of its segments; a law is that of the component."""
    bench = made()
    states = driven_states(bench)
    assert [s.mode for s in states] == ["c0", "c1", "c2", "c3"]
    np.testing.assert_allclose(states[0].strain, DRIVE[:N, None])
    both = np.stack([np.log(1 + DRIVE[:N]), DRIVE[N:]], axis=1)
    np.testing.assert_allclose(states[1].strain, both)
    np.testing.assert_allclose(states[3].strain, both)
    np.testing.assert_allclose(states[2].strain, np.log(2 - DRIVE[:N])[:, None])


@pytest.mark.parametrize("states", [3, 5])
def test_every_segment_has_a_state(states):
    bench = made()
    with pytest.raises(ValueError, match="zip"):
        series(bench, blocks(bench), [State("m", DRIVE[:N, None])] * states)


@pytest.mark.parametrize("several", [1, 2, 5, 29, 30, 31])
def test_blocks_are_in_order_and_hold_every_sample_once(several):
    bench = made()
    cut = blocks(bench, {"force": several, "marker": 3})
    assert cut.counts.sum() == 4 * N
    np.testing.assert_array_equal(cut.starts, np.cumsum([0, *cut.counts[:-1]]))
    assert np.all(np.diff(cut.owner) >= 0)
    assert np.all(cut.starts // N == cut.owner)
    assert np.all(np.bincount(cut.owner) <= several)


def test_without_samples_to_spare_a_block_is_one_sample_whatever_the_way():
    bench = made()
    bench.segments = [replace(s, drive=np.where(np.arange(N) < 15, 1.0, 2.0)) for s in bench.segments]
    assert blocks(bench, {"force": N}).counts.tolist() == [1] * (4 * N)


def test_a_way_may_be_all_in_its_last_step():
    np.testing.assert_array_equal(path(np.array([2.0, 2.0, 5.0])), [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(path(np.array([2.0, 5.0, 5.0])), [0.0, 1.0, 1.0])


@pytest.mark.parametrize("name", ["shear", "twist", "depth"])
def test_what_is_no_stretch_is_a_strain_as_it_is(name):
    segment = replace(made().segments[0], drive_name=name)
    np.testing.assert_array_equal(strain(segment), segment.drive)
