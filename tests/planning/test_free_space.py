"""Where the arm may be, judged by a plant that the code under test has not built."""

import itertools

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from truepath import plants
from truepath.planning.free_space import MARGIN_M
from truepath.planning.ways import Ways

FOLDED = np.array([0, -np.pi / 2, 3.0, 0, 0, 0])  # the forearm in the upper arm
UPRIGHT = np.array([0, -np.pi / 2, 0, -np.pi / 2, 0, 0])


@pytest.fixture(scope="module")
def drake():
    """Function: Drake's query object at joints ``(6,)``."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    parser = Parser(plant)
    parser.package_map().Add("truepath_models", str(plants.models_dir()))
    parser.AddModels(str(plants.models_dir() / "ur5" / "cell.dmd.yaml"))
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()

    def at(q):
        plant.SetPositions(plant.GetMyMutableContextFromRoot(root), q)
        return scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))

    at.diagram = diagram  # which must live as long
    at.inspector = scene_graph.model_inspector()
    return at


def distance_to_the_cell(drake, q):
    """Of any link or tool from table and pedestal, m; the base stands on the pedestal."""
    name = drake.inspector.GetName

    def fixed(geometry):
        return name(geometry).startswith(("table::", "pedestal::"))

    pairs = drake(q).ComputeSignedDistancePairwiseClosestPoints(0.2)
    across = [p.distance for p in pairs if fixed(p.id_A) != fixed(p.id_B)]
    return min(across, default=np.inf)


def test_what_touches_for_drake_is_not_free(anywhere, drake):
    assert not anywhere.space.are_free(FOLDED[None])[0]
    assert anywhere.space.are_free(UPRIGHT[None])[0]
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (80, 6))
    touching = np.array([len(drake(row).ComputePointPairPenetration()) > 0 for row in q])
    assert not (anywhere.space.are_free(q) & touching).any()
    np.testing.assert_array_equal(anywhere.space.cell.collides(q), touching)


def test_free_poses_keep_the_margin_from_table_and_pedestal(anywhere, drake):
    free = anywhere.draw(60, np.random.default_rng(1))
    assert len(free) == 60
    assert min(distance_to_the_cell(drake, q) for q in free) > MARGIN_M


def test_a_way_that_is_blocked_gets_a_detour_that_is_free(anywhere, drake):
    rng = np.random.default_rng(2)
    q = anywhere.draw(40, rng)
    ways, detours = Ways(anywhere.space, anywhere.roadmap), 0
    for start, end in zip(q[0:12:2], q[1:12:2], strict=True):
        straight = np.linspace(start, end, 400)
        blocked = any(len(drake(row).ComputePointPairPenetration()) for row in straight)
        points = ways.between(start, end)
        detours += len(points) > 0
        assert len(points) or not blocked
        corners = np.vstack([start, points, end])
        for a, b in itertools.pairwise(corners):
            fine = np.linspace(a, b, max(int(np.abs(b - a).max() / 0.01), 1) + 1)
            assert not any(len(drake(row).ComputePointPairPenetration()) for row in fine)
    assert detours


def test_the_beam_is_broken_by_whatever_stands_in_it(anywhere, drake):
    """Against many points along the beam, each asked of Drake by itself."""
    q = anywhere.draw(60, np.random.default_rng(3))
    p_WT = np.array([1.2, 0.0, 0.9])
    X = anywhere._reflector(q)
    verdicts = []
    for row, X_WE in zip(q, X, strict=True):
        p_WE, query = X_WE[:3, 3], drake(row)
        own = {d.id_G for d in query.ComputeSignedDistanceToPoint(p_WE) if d.distance <= 0}
        inside = any(
            d.distance < 0 and d.id_G not in own
            for share in np.linspace(0.005, 1, 200)
            for d in query.ComputeSignedDistanceToPoint(p_WE + share * (p_WT - p_WE))
        )
        clear = anywhere.space.beam_is_unbroken(row, p_WE, p_WT)
        verdicts.append(clear)
        assert not (clear and inside)
    assert 5 < sum(verdicts) < 55
