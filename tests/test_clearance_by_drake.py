"""Clearances in the cell of the UR5 are those of a second plant in Drake that is asked without any screening."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from truepath import plants
from truepath.calibrate import calibrate
from truepath.clearance import RANGE_M, Cell
from truepath.correct import correct
from truepath.errors import InputError
from truepath.model import nominal_model
from truepath.programs.toolpath_csv import read_toolpath
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure


@pytest.fixture(scope="module")
def bare_drake():
    """Function: smallest distance of each pair of bodies up to ``range_m``, all of them asked of Drake every time."""
    builder = DiagramBuilder()
    plant, _scene_graph = plants.add_cell(builder, "ur5_cell")
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    nominal_context = plant.GetMyContextFromRoot(root)

    def distances(q, range_m, plant=plant, context=nominal_context):
        plant.SetPositions(context, q)
        query = plant.get_geometry_query_input_port().Eval(context)
        frame_of, found = query.inspector().GetFrameId, {}
        for pair in query.ComputeSignedDistancePairwiseClosestPoints(range_m):
            two = [plant.GetBodyFromFrameId(frame_of(geometry)) for geometry in (pair.id_A, pair.id_B)]
            bodies = tuple(sorted(body.scoped_name().get_full() for body in two))
            found[bodies] = min(found.get(bodies, np.inf), pair.distance)
        return found

    distances.diagram, distances.root = diagram, root  # which must live as long
    return distances


@pytest.fixture(scope="module")
def nominal_cell(ur5):
    return Cell("ur5", nominal_model(ur5))


@pytest.fixture(scope="module")
def weld_path():
    """``(1000, 6)`` along the example program."""
    q = read_toolpath(plants.models_dir() / "ur5" / "weld_path.csv", 6).q_rad
    along = np.linspace(0, len(q) - 1, 1000)
    return np.stack([np.interp(along, np.arange(len(q)), column) for column in q.T], axis=1)


def differences(found, q_rad, truth):
    """How far from ``truth(q)``, m; a pair that only one has in range is to the other at the end of it."""
    all_of_them = []
    for k, q in enumerate(q_rad):
        true = truth(q)
        for bodies in {*true, *found.bodies}:
            both = np.minimum([found.of(bodies)[k], true.get(bodies, np.inf)], found.range_m)
            if (both < found.range_m).any():
                all_of_them.append(np.ptp(both))
    return np.array(all_of_them)


def agree(found, q_rad, truth):
    """To what Drake's distance of two cylinders jumps by when a joint turns by a nanoradian."""
    difference = differences(found, q_rad, truth)
    assert len(difference) > 50
    return np.quantile(difference, 0.98) < 2e-5 and difference.max() < 1e-3


# Against Drake, asked for everything every time


def test_along_a_path_nothing_is_missed(nominal_cell, weld_path, bare_drake):
    found = nominal_cell.clearances(weld_path, range_m=0.03)
    assert found.measured > 0
    assert len(found.bodies) > 3
    assert agree(found, weld_path, lambda q: bare_drake(q, 0.03))


def test_through_collisions_nothing_is_missed(nominal_cell, bare_drake):
    """Long swings through pedestal, table and arm, in steps of half a degree, and single postures."""
    rng = np.random.default_rng(3)
    ends = rng.uniform(-np.pi, np.pi, (8, 6))
    swings = [a + np.linspace(0, 1, 120)[:, None] * np.clip(b - a, -1, 1) for a, b in pairwise(ends)]
    q = np.concatenate([*swings, rng.uniform(-np.pi, np.pi, (60, 6))])
    found = nominal_cell.clearances(q)
    assert (found.distance_m < -0.01).sum() > 50
    assert (found.distance_m > 0.01).sum() > 50
    assert agree(found, q, lambda q: bare_drake(q, RANGE_M))


def test_what_is_not_asked_for_is_far(nominal_cell, bare_drake):
    """Swings in steps so small that most pairs are screened most of the time."""
    rng = np.random.default_rng(3)
    ends = rng.uniform(-np.pi, np.pi, (4, 6))
    q = np.concatenate([a + np.linspace(0, 1, 1200)[:, None] * np.clip(b - a, -1, 1) for a, b in pairwise(ends)])
    found = nominal_cell.clearances(q)
    assert found.measured < 0.9 * len(q)
    assert 0 < np.isfinite(found.distance_m).sum() < found.measured
    assert agree(found, q, lambda q: bare_drake(q, RANGE_M))


def test_no_joint_changes_a_distance_by_more_than_its_reach(nominal_cell):
    """Single turns of a joint; some of the bounds must be nearly met, or they would hold for any reach."""
    pairs, rng, most = nominal_cell._pairs, np.random.default_rng(5), 0.0

    def distances(q):
        query = nominal_cell._at(q)
        return np.array([query.ComputeSignedDistancePairClosestPoints(*ids).distance for ids in pairs.ids])

    for q in rng.uniform(-np.pi, np.pi, (40, 6)):
        joint, turn = rng.integers(6), rng.uniform(0.2, 0.6)
        before, after = distances(q), distances(q + turn * np.eye(6)[joint])
        apart, bound = (before > 0) & (after > 0), turn * pairs.reach_m[:, joint]
        assert (np.abs(after - before)[apart] <= bound[apart] + 5e-3).all()  # 5 mm: Drake, with cylinders far apart
        most = max(
            most, np.max(np.abs(after - before)[apart & (bound > 0.1)] / bound[apart & (bound > 0.1)], initial=0)
        )
    assert most > 0.6


def test_where_drake_finds_no_distance_a_hair_beside_it_does(nominal_cell, monkeypatch, weld_path):
    expected = nominal_cell.clearances(weld_path[:1], range_m=0.03)
    at, asked = nominal_cell._at, []

    def fails_at_first(phi):
        asked.append(phi.copy())
        if len(asked) == 1:
            raise RuntimeError("FCL: the origin is outside of the polytope")
        return at(phi)

    monkeypatch.setattr(nominal_cell, "_at", fails_at_first)
    found = nominal_cell.clearances(weld_path[:1], range_m=0.03)
    assert len(asked) == 2
    assert found.distance_m == pytest.approx(expected.distance_m, abs=1e-5)

    def fails_always(phi):
        raise RuntimeError("FCL: the origin is outside of the polytope")

    monkeypatch.setattr(nominal_cell, "_at", fails_always)
    with pytest.raises(InputError, match="cannot tell a distance") as caught:
        nominal_cell.clearances(weld_path[:1])
    assert "polytope" in caught.value.found


def test_a_path_far_from_everything_is_hardly_asked_for(nominal_cell, bare_drake):
    start = np.array([0.0, -1.2, 0.9, -1.3, -1.2, 0.3])
    q = start + np.linspace(0, 1, 5000)[:, None] * [0.5, 0.1, 0.1, 0.1, 0.1, 0.1]
    assert not any(bare_drake(row, RANGE_M) for row in q[::50])
    found = nominal_cell.clearances(q)
    assert found.bodies == ()
    assert np.isinf(found.distance_m).all()
    assert found.measured < 0.2 * len(q)


# The robot that really stands there


@pytest.fixture(scope="module")
def real():
    return RealRobot("ur5", 0)


@pytest.fixture(scope="module")
def model(real):
    """Calibrated, with what is known of where base and reflector are meant to be."""
    data = measure(real, free_poses(real, 150, np.random.default_rng(0)), Campaign())
    stated = replace(data, X_MB_nominal=real.robot.X_WB, X_FE_nominal=real.robot.X_FR)
    return calibrate(real.robot, stated).model


def test_the_calibrated_cell_is_the_real_one(real, model, nominal_cell, bare_drake):
    """Hidden errors of all frames, in Drake. Left is what a reflector does not show: how the tool is turned."""
    q = free_poses(real, 80, np.random.default_rng(1))
    cells = {"calibrated": Cell("ur5", model), "nominal": nominal_cell}
    found = {name: cell.clearances(q, range_m=0.3) for name, cell in cells.items()}
    errors = {name: [] for name in cells}
    for k, row in enumerate(q):
        for bodies, distance in bare_drake(row, 0.25, real.plant, real._context).items():
            if bodies[0].startswith(("table", "pedestal")) and bodies[1].startswith("tool"):
                for name in cells:
                    errors[name].append(found[name].of(bodies)[k] - distance)
    rms = {name: np.sqrt(np.mean(np.square(values))) for name, values in errors.items()}
    assert len(errors["nominal"]) > 20
    assert rms["nominal"] > 1e-3
    assert rms["calibrated"] < 0.4e-3


def test_corrected_joints_bring_the_tool_as_near_as_the_program_means_it(model, bare_drake, weld_path):
    """The correction knows nothing of shapes, the nominal cell nothing of the calibration: here they meet."""
    q, cell, pair = weld_path[::25], Cell("ur5", model), ("table::workpiece", "tool::tool")
    meant = np.array([bare_drake(row, 1.0)[pair] for row in q])
    before, after = (cell.clearances(joints, range_m=1.0).of(pair) for joints in (q, correct(model, q).q_rad))
    assert np.abs(after - meant).max() < 2e-5
    assert np.abs(before - meant).max() > 0.3e-3
