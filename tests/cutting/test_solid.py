"""A cut in three dimensions: curved edge, drawn at a slant, deeper along the path, not cut through."""

import numpy as np
import pytest

from tests.cutting.slabs import EDGE, drawn
from tissuejax.tled.simulate import run

HEIGHT, H = 8e-3, 1e-3


@pytest.fixture(scope="module")
def ran():
    scene, tip = drawn(h=H)
    return run(scene), tip


def swept(tip):
    """Area of the plane of the cut that the edge has passed over on its way from `tip[0]` on, m^2."""
    x, z = np.meshgrid(np.linspace(0, 0.014, 801), np.linspace(0, HEIGHT, 451), indexing="ij")
    over = np.zeros(x.shape, bool)
    for at in tip:
        up = z - at[2]
        over |= (up > 0) & (x < at[0] + EDGE[0] * up + EDGE[1] * up**2)
    return float(over.mean()) * 0.014 * HEIGHT


def test_every_frame_accounts_for_its_work(ran):
    out, _ = ran
    work = np.asarray(out.balance.work)
    late = work > 0.05 * work[-1]
    assert np.abs(np.asarray(out.balance.error))[late].max() < 0.005
    assert float(out.balance.friction[-1]) > 0.05 * work[-1]


def test_faces_part_behind_the_edge_within_a_bevel(ran):
    """The blade is as wide as the separation (1.3 mm) within its bevel (3.7 mm): the front follows no farther behind,
    and what is parted lies in what the edge has swept."""
    out, tip = ran
    area, front = np.asarray(out.balance.area), float(out.balance.front[-1])
    assert (np.diff(area) >= -1e-12).all()
    bevel = 1e-3 / np.tan(np.radians(15))
    assert tip[-1, 0] - bevel - H < front < tip[-1, 0]
    assert 0.2 * swept(tip) < area[-1] < swept(tip)


def test_the_tissue_below_the_blade_stays_whole(ran):
    out, tip = ran
    deepest = HEIGHT - tip[:, 2].min()
    reached = float(out.balance.front[-1])
    assert float(out.balance.area[-1]) < reached * deepest


def test_a_slanting_blade_is_pushed_up_and_back_and_not_aside(ran):
    out, _ = ran
    force = np.asarray(out.force)[12:]
    assert (force[:, 0] < 0).all()
    assert np.abs(force[:, 1]).max() < 1e-3 * np.abs(force[:, 0]).max()
    assert force[:, 2].mean() > 0
