"""Means over blocks of samples: where blocks begin, how many there are, and what a discrepancy is told of them."""

import numpy as np
import pytest
from straight_bench import TIME, N, straight

from tissuejax.diagnosis.judgement.blocks import Blocks, State, blocks, driven_states, path, series, smoothed, strain
from tissuejax.diagnosis.judgement.particular import Means
from tissuejax.estimation.discrepancy import loading_states
from tissuejax.estimation.series import Segment

CUT = Blocks(np.array([0, 3, 4]), np.array([3, 1, 2]), np.array([0, 0, 1]))


def test_means_and_their_spread():
    """Of three, one and two samples; of independent errors the mean of n has sigma over the root of n."""
    x = np.array([1.0, 2.0, 6.0, 4.0, 5.0, 8.0])
    assert CUT.mean(x).tolist() == [3.0, 4.0, 6.5]
    np.testing.assert_allclose(CUT.mean(np.stack([x, -x], axis=1)), [[3, -3], [4, -4], [6.5, -6.5]])
    spread = CUT.spread(np.array([3.0, 4.0, 12.0, 2.0, 0.3, 0.4]))
    np.testing.assert_allclose(spread, [13 / 3, 2.0, 0.25])


def test_a_way_is_its_length_so_far_there_and_back():
    assert path(np.array([0.0, 2.0, 1.0, 1.0, 2.0])).tolist() == [0.0, 0.5, 0.75, 0.75, 1.0]
    assert path(np.full(5, 3.0)).tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]  # of what never moves even steps


def test_a_curve_between_the_means_of_pieces():
    y = np.array([0.0, 2.0, 4.0, 6.0, 7.0, 9.0])
    # means 1, 5 and 8 of pairs, whose middles are 0.5, 2.5 and 4.5
    np.testing.assert_allclose(smoothed(y, 3), [1.0, 2.0, 4.0, 5.75, 7.25, 8.0])
    np.testing.assert_allclose(smoothed(y, 99), y)
    np.testing.assert_allclose(smoothed(y, 1), np.full(6, np.mean(y)))


def one(time, drive, y, channel="force", drive_name="shear"):
    """A bench of one segment."""
    made = straight({})
    made.segments = [Segment("r", channel, "", slice(0, len(time)), time, "N", drive, drive_name, "1")]
    made.y, made.sigma = y, np.full(len(time), 0.1)
    return made


def test_blocks_are_short_where_the_specimen_moves_or_its_stress_changes():
    """A third of the way each: time goes on evenly, all strain comes in the first quarter, all stress in the last."""
    n = 400
    s = np.arange(n) / (n - 1)
    bench = one(s, np.minimum(4 * s, 1.0), np.maximum(4 * s - 3, 0.0))
    cut = blocks(bench, {"force": 40})
    assert len(cut.starts) == len(cut.counts) == len(cut.owner) == 40
    assert cut.counts.sum() == n
    assert cut.starts[0] == 0
    assert np.all(np.diff(cut.starts) == cut.counts[:-1])
    # (1/4 + 1) / 3 of all blocks in the first quarter of the time, 1/6 in the two quarters amid
    quarters = np.histogram(s[cut.starts], [0, 0.25, 0.75, 1.01])[0]
    np.testing.assert_allclose(quarters, [40 * 5 / 12, 40 / 6, 40 * 5 / 12], atol=1.01)


def test_where_samples_are_few_each_is_its_own():
    bench = one(np.arange(7.0), np.arange(7.0), np.arange(7.0))
    for wanted in (7, 8, 100):
        cut = blocks(bench, {"force": wanted})
        assert cut.starts.tolist() == list(range(7))
        assert cut.counts.tolist() == [1] * 7


@pytest.mark.parametrize(("segments", "expected"), [(1, 50), (2, 40), (4, 20), (9, 12)])
def test_all_segments_share_what_is_counted_in_all_within_bounds(segments, expected):
    """Of 80 in all at most 50 and at least 12 each."""
    n = 300
    s = np.linspace(0, 1, n)
    bench = one(s, s, s)
    bench.segments = [
        Segment(f"r{k}", "force", "", slice(k * n, (k + 1) * n), s, "N", s, "shear", "1") for k in range(segments)
    ]
    bench.y = np.tile(s, segments)
    cut = blocks(bench, means=Means(whole=80, least=12, most=50))
    assert np.bincount(cut.owner).tolist() == [expected] * segments
    assert [cut.starts[cut.owner == k][0] for k in range(segments)] == [k * n for k in range(segments)]


def test_channels_have_as_many_as_is_said_of_them():
    bench = straight({})
    bench.segments[1] = bench.segments[1].__class__(**{**vars(bench.segments[1]), "channel": "marker"})
    cut = blocks(bench, {"force": 5, "marker": 9})
    assert np.bincount(cut.owner).tolist() == [5, 9]


def test_series_are_the_means_of_what_drives_and_the_largest_stress_of_the_recording():
    bench = straight({})
    bench.segments[1] = bench.segments[1].__class__(**{**vars(bench.segments[1]), "recording": "p"})
    bench.y[N:] *= 3.0
    cut = blocks(bench, {"force": 10})
    states = [State("pull", np.stack([s.drive, 2 * s.drive], axis=1)) for s in bench.segments]
    found = series(bench, cut, states, means=Means(peak=0.5), starts={"p": 77.0})
    for k, (one_of, s) in enumerate(zip(found, bench.segments, strict=True)):
        own = Blocks(cut.starts[cut.owner == k] - k * N, cut.counts[cut.owner == k], np.zeros(0, int))
        assert (one_of.recording, one_of.mode, one_of.start) == ("p", "pull", 77.0)
        np.testing.assert_allclose(one_of.time, own.mean(TIME))
        np.testing.assert_allclose(one_of.strain, own.mean(states[k].strain))
        np.testing.assert_allclose(one_of.states, own.mean(loading_states(s.drive)))
        assert one_of.peak == pytest.approx(np.median(np.abs(bench.y[N:])))
    bench.y[:] = 0.0
    assert [s.peak for s in series(bench, cut, states)] == [1.0, 1.0]
    assert [s.start for s in series(bench, cut, states)] == [0.0, 0.0]


def test_strain_is_the_logarithm_of_a_stretch_and_a_shear_as_it_is():
    bench = one(np.arange(3.0), np.array([1.0, 1.2, 0.8]), np.zeros(3), drive_name="stretch")
    np.testing.assert_allclose(strain(bench.segments[0]), np.log([1.0, 1.2, 0.8]))
    (state,) = driven_states(bench)
    np.testing.assert_allclose(state.strain, np.log([[1.0], [1.2], [0.8]]))
    assert state.mode == ""
    shear = one(np.arange(3.0), np.array([1.0, 1.2, 0.8]), np.zeros(3))
    np.testing.assert_allclose(strain(shear.segments[0]), [1.0, 1.2, 0.8])
