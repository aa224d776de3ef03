"""Level of detail, colours and marks of the preview, against what can be worked out by hand."""

import numpy as np
import pytest
from matplotlib import colormaps
from truepath.model import nominal_flange_poses
from truepath.preview.colours import ERROR_SCALE, error_colours, scale_end_mm, unit_rgb
from truepath.preview.covered import covered_surface
from truepath.preview.geometry import arrows, triads, tube
from truepath.preview.scene import worth_a_mark
from truepath.preview.thinning import LINE_LIMIT, thin_out
from truepath.preview.toolpaths import fine_positions
from truepath.region import cover


class TestThinning:
    def test_keeps_the_corners(self):
        along = np.linspace(0.0, 1.0, 50_001)[:, None]
        corner, end = np.array([0.3, 0.7, 0.0]), np.array([1.0, 0.0, 0.0])
        points = np.concatenate([along * corner, corner + along[1:] * (end - corner)])
        assert thin_out(points, tolerance=1e-9).tolist() == [0, 50_000, 100_000]

    def test_spends_its_points_where_they_are_needed(self):
        """A spiral of 40 turns: 50 chords a turn leave a sagitta of 1 - cos(pi / 50) of the radius everywhere."""
        angle = np.linspace(0.0, 80 * np.pi, 20_000)
        points = np.stack([np.cos(angle), np.sin(angle), 0.001 * angle], axis=1)
        kept = thin_out(points, tolerance=1e-6)
        assert len(kept) <= LINE_LIMIT
        assert np.diff(angle[kept]).max() < 3 * 2 * np.pi / 50

    def test_with_times_a_standstill_stays(self):
        """On the same straight line, but waiting in its middle: only the times tell."""
        way = np.interp(np.arange(101), [0, 40, 60, 100], [0.0, 0.5, 0.5, 1.0])[:, None]
        assert thin_out(way, tolerance=1e-9).tolist() == [0, 100]
        assert thin_out(way, tolerance=1e-9, at=np.arange(101.0)).tolist() == [0, 40, 60, 100]


class TestFinePositions:
    def test_show_the_arc_between_distant_waypoints(self):
        position = fine_positions(np.array([[0.0, 0.0], [1.0, 0.2], [1.0, 0.2]]))
        assert {0.0, 1.0, 2.0} <= set(position.tolist())
        assert 15 < len(position) < 30

    def test_add_nothing_where_no_way_leads(self):
        q = np.array([[0.0, 0.0], [1.0, 0.2], [2.0, 0.2]])
        position = fine_positions(q, np.array([False, False, True]))
        assert not ((position > 0) & (position < 1)).any()
        assert ((position > 1) & (position < 2)).any()


class TestColours:
    def test_are_those_of_plasma(self):
        """Of its darker part, in even steps: a scale made for colour-blind readers by others."""
        for k, colour in enumerate(ERROR_SCALE):
            np.testing.assert_allclose(unit_rgb(colour), colormaps["plasma"](0.1 * k)[:3], atol=0.003)

    def test_get_brighter_with_the_error(self):
        brightness = error_colours(np.linspace(0, 2.0, 50), 2.0) @ [0.2126, 0.7152, 0.0722]
        assert (np.diff(brightness) > 0).all()

    @pytest.mark.parametrize(
        ("errors", "end"),
        [([0.1, 1.829], 2.0), ([0.3], 0.5), ([2.2], 2.5), ([0.05], 0.05), ([7.0], 10.0), ([0.0], 1e-3)],
    )
    def test_end_at_a_round_number(self, errors, end):
        assert scale_end_mm(np.array(errors)) == pytest.approx(end)


class TestShapes:
    def test_pieces_of_a_line_are_not_connected(self):
        points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
        mesh = tube(points, 0.01, piece=np.array([0, 0, 1, 1]))
        x = mesh.vertices[mesh.faces][:, :, 0]
        assert np.ptp(x, axis=1).max() == pytest.approx(1.0)
        assert not ((x.min(axis=1) < 1.5) & (x.max(axis=1) > 1.5)).any()

    def test_arrows_reach_from_start_to_end(self):
        start, end = np.array([[0.1, 0.2, 0.3]]), np.array([[0.4, 0.6, 0.3]])
        mesh = arrows(start, end, 0.002, np.array([[1.0, 0, 0]]))
        along = (mesh.vertices - start) @ np.array([0.6, 0.8, 0.0])
        assert (along.min(), along.max()) == (pytest.approx(0.0, abs=1e-6), pytest.approx(0.5))
        assert arrows(start, start, 0.002, np.array([[1.0, 0, 0]])) is None

    def test_triads_show_the_columns_of_a_frame(self):
        X = np.eye(4)
        X[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
        X[:3, 3] = [1.0, 2.0, 3.0]
        colours = np.eye(3)
        mesh = triads(X[None], 0.1, 1e-6, colours)
        for axis in range(3):
            mine = mesh.vertices[mesh.color[:, axis] == 1]
            tip = mine[np.argmax(np.linalg.norm(mine - X[:3, 3], axis=1))]
            np.testing.assert_allclose(tip - X[:3, 3], 0.1 * X[:3, axis], atol=1e-5)

    def test_marks_are_few_and_hold_the_worst(self):
        points = np.stack([np.linspace(0, 1, 5000) ** 3, np.zeros(5000), np.zeros(5000)], axis=1)
        error = np.ones(5000)
        error[1234] = 2.0
        marks = worth_a_mark(points, error, 24)
        assert {0, 1234, 4999} <= set(marks.tolist())
        assert len(marks) <= 26
        others = marks[marks != 1234]
        assert np.diff(points[others, 0]).max() < 2.0 / 22


class TestTheCoveredRegion:
    def test_holds_the_poses_of_the_data(self, calibration):
        """Its box is that of flange positions reached by joints drawn by the region's own rule, found another way."""
        region, robot = calibration.region.region(), calibration.model.robot
        vertices, faces = covered_surface(region, robot)
        rng = np.random.default_rng(5)
        q = rng.uniform(region.lower_rad, region.upper_rad, (40_000, 6))
        p = nominal_flange_poses(robot, q[region.contains(q)])[:, :3, 3]
        np.testing.assert_allclose(vertices.min(axis=0), np.quantile(p, 0.002, axis=0), atol=0.12)
        np.testing.assert_allclose(vertices.max(axis=0), np.quantile(p, 0.998, axis=0), atol=0.12)
        assert faces.max() == len(vertices) - 1

    def test_is_closed(self, calibration):
        _, faces = covered_surface(calibration.region.region(), calibration.model.robot)
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        _, count = np.unique(edges, axis=0, return_counts=True)
        assert (count % 2 == 0).all()

    def test_of_joints_that_hardly_moved_is_small(self, calibration):
        q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + np.random.default_rng(1).normal(scale=1e-3, size=(30, 6))
        surface = covered_surface(cover(q), calibration.model.robot)
        assert surface is None or np.ptp(surface[0], axis=0).max() < 0.25
