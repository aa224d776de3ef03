"""A program, the robot today and the robot with the correction, drawn into a host's own Meshcat."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from truepath import lie
from truepath.host.captions import LEGEND_PX, PLACE_PX, STILL_PX, draw_legend, draw_place
from truepath.host.course import Course, moved_points
from truepath.host.drawn_arm import DrawnArm, body_path, moved_bodies
from truepath.host.lines_drawn import draw_arrows, draw_frames, draw_line, show_through
from truepath.host.live_camera import beginning
from truepath.host.live_spot import free_spot, holds_spot, take_spot
from truepath.host.on_screen import Pane
from truepath.host.placed_robot import PlacedRobot
from truepath.lie import Array
from truepath.preview.colours import (
    BAND_OPACITY,
    CORRECTED,
    OUTSIDE,
    PROGRAMMED,
    REGION,
    UNCORRECTED,
    error_colours,
    scale_end_mm,
    unit_rgb,
)
from truepath.preview.covered import covered_surface
from truepath.preview.keyframes import joints_reaching
from truepath.preview.toolpaths import Magnification, magnification_of

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat, Rgba, SceneGraph
    from pydrake.systems.framework import Context

    from truepath.calibration_parts import StatisticsPart

PARTS = (
    "programmed",
    "real",
    "corrected",
    "arm_uncorrected",
    "arm_corrected",
    "error_vectors",
    "tool_frames",
    "region",
)
PREFIXES_OF_DRAKE = ("visualizer", "illustration")  # of MeshcatVisualizer; of AddDefaultVisualization
HIDDEN_AT_FIRST = ("region",)  # it lies around all else, and fogs it
GHOST_OPACITY, REGION_OPACITY, HIDDEN_OPACITY = 0.3, 0.08, 0.3
MOST_VECTORS, MOST_FRAMES = 66, 12
LINE_SHARE, BAND, POINT_SHARE, FRAME_SHARE, MARKER_SHARE = 0.0022, 2.6, 0.010, 0.05, 0.028  # of the size of the robot
GAP_PX = 2  # between panes


class LiveView:
    """Everything below the prefix of its spot in a Meshcat, and two panes of text that the camera carries.

    Parts, which can be shown and hidden: the lines of the tool ``programmed``, ``real`` (today) and ``corrected``; the
    arms ``arm_uncorrected`` (a ghost) and ``arm_corrected``; ``error_vectors``, from where the tool is meant to be to
    where it is today; ``tool_frames`` at some waypoints; ``region``, hidden at first, around all places where the
    calibration knows the flange in some posture. Errors are drawn larger than they are, and the arms on these lines.

    Draws with contexts of its own: nothing of the host's plant is changed. Of the host's scene it hides the arm, where
    the host draws that itself, and turns the camera if told so (``look``).

    Args:
        meshcat: the host's.
        robot: the calibrated robot in the host's world.
        course: what is shown.
        scene_graph: with which the host's plant is registered: where the shapes of the arms come from. None: rods.
        drawn_below: prefix of the host's ``MeshcatVisualizer``; None: those that Drake has by itself.
        magnification: factor by which errors are drawn, or "auto".
        title: of the legend.
        controls: whether there will be some, as the text says.
        context: of the plant, in which all but the joints of the arm stands as it is to be drawn; None: the default.
        model_error: of the calibration on poses that it had not seen, for the legend; None: unknown.

    Raises:
        InputError: a magnification that makes no sense. Nothing is drawn then.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        robot: PlacedRobot,
        course: Course,
        *,
        scene_graph: SceneGraph | None = None,
        drawn_below: str | None = None,
        magnification: Magnification = 50.0,
        title: str = "",
        controls: bool = True,
        context: Context | None = None,
        model_error: StatisticsPart | None = None,
    ) -> None:
        assert robot.place is not None, "a robot in a host's plant"
        self.meshcat, self.robot, self.course, self.title = meshcat, robot, course, title
        self.place, self.by_error = 0.0, True
        self.magnification = magnification_of(course.fine.paths.at(course.fine.waypoint), magnification)
        self.chosen: int | None = None
        self.visible = {part: part not in HIDDEN_AT_FIRST for part in PARTS}
        self._model_error = model_error
        plant = robot.place.plant
        self.spot = take_spot(meshcat, plant.GetModelInstanceName(robot.place.arm.instance), self)
        self._prefix, self._keys = self.spot.prefix, self.spot.has_keys if controls else None
        self._legend, self._place = self._make_panes()
        p_B = (course.meant - robot.X_WB[:3, 3]) @ robot.X_WB[:3, :3]
        self._size = max(float(np.linalg.norm(p_B, axis=1).max()), 0.1)
        self._scale_mm = scale_end_mm(course.real_mm)
        self._arms = self._make_arms(scene_graph, context)
        prefixes = PREFIXES_OF_DRAKE if drawn_below is None else (drawn_below,)
        own = [body_path(body) for body in moved_bodies(robot.place)]
        self.spot.hide(meshcat, [f"{prefix.rstrip('/')}/{path}" for prefix in prefixes for path in own])
        self._draw_what_stays()
        self._draw_lines()
        for part, visible in self.visible.items():
            self._set_visible(part, visible)
        self.go_to(0.0)
        self.write()

    # --- what the operator does -----------------------------------------------------------------------------

    def go_to(self, share: float) -> None:
        """Moves both arms to a place along the path, a share of the time from 0 to 1."""
        self.place = min(max(float(share), 0.0), 1.0)
        before, after, within = self.course.at(self.place)
        for name, arm, q, points in self._arms:
            arm.put((1 - within) * q[before] + within * q[after])
            self._move(f"{self._prefix}/{name}/tool_point", (1 - within) * points[before] + within * points[after])

    def magnify(self, factor: float) -> None:
        """Draws errors larger by another factor."""
        if factor != self.magnification:
            self.magnification = magnification_of(self.course.fine.paths, factor)
            self._draw_lines()
            self.go_to(self.place)
            self.write()

    def show(self, part: str, visible: bool) -> None:
        """Shows or hides one of the parts."""
        if part not in self.visible:
            raise KeyError(f"no part {part!r} of the view; there are {', '.join(self.visible)}")
        self.visible[part] = visible
        self._set_visible(part, visible)
        self.write_legend()

    def colour_by_error(self, on: bool) -> None:
        """Gives the line of the real tool and the arrows the colours of their errors, or one."""
        self.by_error = on
        self._draw_lines()
        self.write()

    def step(self, by: int) -> str | None:
        """Goes to the next (+1) or previous (-1) warning, marks it and says it; None where there are none."""
        remarks = self.course.remarks
        if not remarks:
            return None
        chosen = (0 if by > 0 else len(remarks) - 1) if self.chosen is None else (self.chosen + by) % len(remarks)
        self.chosen = chosen
        waypoint = remarks[chosen].waypoint
        if waypoint is None:
            self.meshcat.Delete(f"{self._prefix}/warning")
        else:
            self.go_to(self.course.share_of(waypoint))
            self._mark(self.course.meant[self.course.fine.waypoint[waypoint]])
        self.write_place()
        return remarks[chosen].text

    # --- text and camera ------------------------------------------------------------------------------------

    def write(self) -> None:
        """Writes both panes anew."""
        self.write_legend()
        self.write_place()

    def write_legend(self) -> None:
        """Writes what the lines and parts are."""
        figure, scale = self._legend.figure(), self._scale_mm if self.by_error else None
        draw_legend(figure, self.course, self.title, self.magnification, scale, self.visible, self._model_error)
        self._legend.put(figure)

    def write_place(self) -> None:
        """Writes where the arms are; slower than moving them, so it is for the caller to say how often."""
        figure = self._place.figure()
        draw_place(figure, self.course, self.place, self.chosen, self._keys)
        self._place.put(figure)

    def look(self) -> None:
        """Turns the camera so that path and arm are beside each other. Nobody can tell where it was before."""
        self.meshcat.SetCameraPose(*beginning(self.robot.X_WB[:3, 3], self.course.meant, self._size))

    def remove(self) -> None:
        """Takes all of it away, controls too; what was hidden of the host is seen again."""
        free_spot(self.meshcat, self.spot)

    @property
    def is_removed(self) -> bool:
        """Whether it was taken away."""
        return not holds_spot(self.meshcat, self.spot)

    # --- drawing --------------------------------------------------------------------------------------------

    def _make_panes(self) -> tuple[Pane, Pane]:
        """At the bottom, the legend above the place; those of further views at the top, one below the other."""
        place_px = STILL_PX if self._keys is None else PLACE_PX
        both, number = LEGEND_PX[1] + PLACE_PX[1] + 2 * GAP_PX, self.spot.number
        edge: Literal["top", "bottom"] = "bottom" if number == 0 else "top"
        first = both * max(number - 1, 0)
        below, above = (first, first + place_px[1] + GAP_PX), (first + LEGEND_PX[1] + GAP_PX, first)
        off_place, off_legend = below if number == 0 else above
        legend = Pane(self.meshcat, f"truepath_legend_{number}", *LEGEND_PX, edge, off_legend)
        place = Pane(self.meshcat, f"truepath_place_{number}", *place_px, edge, off_place)
        self.spot.paths += [legend.path, place.path]
        return legend, place

    def _make_arms(
        self, scene_graph: SceneGraph | None, context: Context | None
    ) -> list[tuple[str, DrawnArm, Array, Array]]:
        from pydrake.geometry import Sphere

        arms, place = [], self.robot.place
        assert place is not None
        for name, colour, paint in (
            ("arm_corrected", CORRECTED, None),
            ("arm_uncorrected", UNCORRECTED, _rgba(UNCORRECTED, GHOST_OPACITY)),
        ):
            path, nothing = f"{self._prefix}/{name}", np.zeros((0, 3))
            arms.append((name, DrawnArm(self.meshcat, path, place, scene_graph, paint, context), nothing, nothing))
            self.meshcat.SetObject(f"{path}/tool_point", Sphere(POINT_SHARE * self._size), _rgba(colour))
        return arms

    def _draw_what_stays(self) -> None:
        course = self.course
        shades = np.where(course.fine.outside[:, None], unit_rgb(OUTSIDE), unit_rgb(PROGRAMMED))
        self._line("programmed", course.meant[course.kept], shades[course.kept], BAND, far_walls_only=True)
        self.meshcat.SetProperty(f"{self._prefix}/programmed", "opacity", BAND_OPACITY)
        waypoints = course.fine.waypoint
        some = waypoints[np.unique(np.linspace(0, len(waypoints) - 1, min(len(waypoints), MOST_FRAMES)).astype(int))]
        draw_frames(self.meshcat, f"{self._prefix}/tool_frames", course.X_WT[some], FRAME_SHARE * self._size)
        surface = covered_surface(self.robot.region, self.robot.model.robot)
        if surface is not None:
            vertices, faces = np.asfortranarray(moved_points(self.robot.X_WB, surface[0]).T), surface[1].T
            colour = _rgba(REGION, REGION_OPACITY)
            far = type(self.meshcat).SideOfFaceToRender.kBackSide
            faces = np.asfortranarray(faces, np.int32)
            self.meshcat.SetTriangleMesh(f"{self._prefix}/region", vertices, faces, colour, side=far)

    def _draw_lines(self) -> None:
        course, robot, kept = self.course, self.robot, self.course.kept
        drawn = {}
        by_error = error_colours(course.real_mm[kept], self._scale_mm)
        real_shades = by_error if self.by_error else np.broadcast_to(unit_rgb(UNCORRECTED), by_error.shape)
        for part, points, shades in (
            ("real", course.real, real_shades),
            ("corrected", course.corrected, unit_rgb(CORRECTED)),
        ):
            drawn[part] = course.drawn(points, self.magnification)[kept]
            self._line(f"{part}/line", drawn[part], shades)
            if self._line(f"{part}/hidden", drawn[part], shades):
                show_through(self.meshcat, f"{self._prefix}/{part}/hidden", HIDDEN_OPACITY)
        some = np.unique(np.linspace(0, len(kept) - 1, MOST_VECTORS).astype(int))
        ends, path = (course.meant[kept][some], drawn["real"][some]), f"{self._prefix}/error_vectors"
        draw_arrows(self.meshcat, path, *ends, 0.4 * LINE_SHARE * self._size, real_shades[some])
        X_BW, q = lie.invert(robot.X_WB), course.fine.q_meant[kept]
        self._arms = [
            (name, arm, joints_reaching(robot.model.robot, moved_points(X_BW, points), course.p_FT, q), points)
            for (name, arm, _, _), points in zip(self._arms, (drawn["corrected"], drawn["real"]), strict=False)
        ]

    def _line(
        self, part: str, points: Array, colours: Array, width: float = 1.0, *, far_walls_only: bool = False
    ) -> bool:
        radius, piece = width * LINE_SHARE * self._size, self.course.fine.piece[self.course.kept]
        return draw_line(
            self.meshcat, f"{self._prefix}/{part}", points, radius, colours, piece, far_walls_only=far_walls_only
        )

    def _mark(self, p_W: Array) -> None:
        from pydrake.geometry import Sphere

        self.meshcat.SetObject(
            path := f"{self._prefix}/warning", Sphere(MARKER_SHARE * self._size), _rgba(OUTSIDE, 0.5)
        )
        self._move(path, p_W)

    def _move(self, path: str, p_W: Array) -> None:
        self.meshcat.SetTransform(path, np.asfortranarray(lie.make_pose(translation=p_W)))

    def _set_visible(self, part: str, visible: bool) -> None:
        self.meshcat.SetProperty(f"{self._prefix}/{part}", "visible", visible)


def _rgba(colour: str, alpha: float = 1.0) -> Rgba:
    from pydrake.geometry import Rgba

    return Rgba(*(float(channel) for channel in unit_rgb(colour)), alpha)
