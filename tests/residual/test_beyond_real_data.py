"""On the real UR5, beyond the angles that it has learnt from, a network never costs more than a twentieth."""

from dataclasses import replace

import numpy as np
import pytest
from odd_robot import QUICK
from truepath.calibrate import calibrate
from truepath.context import Context
from truepath.learn import with_network
from truepath.readers import read_measurements

SLAB_DEG = 15.0  # at an end of a joint's range, of which nothing is learnt
WORST = 1.05


ENDS = [(1, False), (1, True), (2, False), (2, True), (3, True), (4, False), (5, False), (5, True)]  # with poses to see


def at_an_end(joint, upper):
    """The first joint, in which a network was found to lose, at once; the others for those who have time."""
    return pytest.param(joint, upper, marks=() if joint == 1 else pytest.mark.slow)


@pytest.fixture(scope="module")
def measured(ur5, data_dir):
    return read_measurements(data_dir / "ur5_jacobi2025" / "grid.csv", ur5, "jacobi2025")


@pytest.mark.parametrize(("joint", "upper"), [at_an_end(*end) for end in ENDS])
def test_poses_beyond_the_data_are_not_worse_with_networks(ur5, measured, joint, upper):
    angle = (1 if upper else -1) * measured.q_rad[:, joint - 1]
    beyond = angle > angle.max() - np.radians(SLAB_DEG)
    known, fresh = measured.subset(~beyond), measured.subset(beyond)
    model = with_network(calibrate(ur5, known), known, Context.of(known), QUICK).model
    context = Context.of(fresh)
    with_it, without = (
        np.linalg.norm(each.predict(context)[:, :3, 3] - fresh.p_ME, axis=1)
        for each in (model, replace(model, residual=None))
    )
    speaks = with_it != without
    assert speaks.any()
    assert with_it[speaks].mean() <= WORST * without[speaks].mean()
