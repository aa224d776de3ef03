"""The arm that is drawn: where its tool is, and what it is made of."""

import numpy as np
import pytest
from truepath.errors import InputError
from truepath.model import nominal_flange_poses
from truepath.plants import models_dir
from truepath.preview import write_preview
from truepath.preview.keyframes import animate
from truepath.preview.shown import ShownPath
from truepath.preview.toolpaths import FinePaths, Toolpaths, interpolate


class TestTheArm:
    def test_has_its_tool_on_the_drawn_line(self, calibration, q_programmed, q_corrected):
        """At the key frames, and anywhere between them within what can be seen."""
        model, shown = calibration.model, ShownPath.of_joints(q_programmed, q_corrected)
        fine = FinePaths.of(model, shown, np.zeros(len(q_programmed), bool))
        frames = animate(model, fine, model.X_FE[:3, 3], magnification=50.0)
        everywhere = np.linspace(0, len(q_programmed) - 1, 777)
        for at, tolerance in ((frames.position, 1e-4), (everywhere, 1e-3)):
            programmed, corrected = interpolate(q_programmed, at), interpolate(q_corrected, at)
            drawn = Toolpaths.of(model, programmed, programmed, corrected).magnified(50.0)
            frame = np.interp(at, frames.position, np.arange(len(frames.position)))
            for q, points in ((frames.q_uncorrected, drawn.uncorrected), (frames.q_corrected, drawn.corrected)):
                tool = (nominal_flange_poses(model.robot, interpolate(q, frame)) @ model.X_FE)[:, :3, 3]
                np.testing.assert_allclose(tool, points, atol=tolerance)

    def test_is_at_the_worst_point_in_some_frame(self, calibration, q_programmed, q_corrected):
        model, shown = calibration.model, ShownPath.of_joints(q_programmed, q_corrected)
        fine = FinePaths.of(model, shown, np.zeros(len(q_programmed), bool))
        frames = animate(model, fine, model.X_FE[:3, 3], magnification=50.0)
        assert frames.error_uncorrected_mm.max() == fine.paths.errors_mm()[0].max()
        assert frames.position[[0, -1]].tolist() == [0, len(q_programmed) - 1]
        assert (np.diff(frames.time_s) >= 0).all()

    def test_is_found_within_a_cell(self, tmp_path, calibration, q_programmed, q_corrected):
        pages = []
        for source in ("ur5", models_dir() / "ur5" / "cell.dmd.yaml"):
            write_preview(tmp_path / "p.html", calibration, q_programmed, q_corrected, robot_source=source)
            pages.append((tmp_path / "p.html").read_bytes())
        assert pages[0] == pages[1]

    def test_may_be_made_of_meshes(self, tmp_path, calibration, q_programmed, q_corrected):
        """Each mesh is stored once, although arm and ghost both have it; one that is missing is told."""
        import trimesh

        (tmp_path / "meshes").mkdir()
        (tmp_path / "package.xml").write_text("<package><name>my_robot</name></package>")
        trimesh.creation.icosphere(subdivisions=5, radius=0.06).export(tmp_path / "meshes" / "ball.stl")
        urdf = (models_dir() / "ur5" / "ur5.urdf").read_text()
        for shape, name in (
            ('<cylinder radius="0.046" length="0.425"/>', "ball.stl"),
            ('<cylinder radius="0.0564" length="0.012"/>', "gone.stl"),
        ):
            urdf = urdf.replace(shape, f'<mesh filename="package://my_robot/meshes/{name}"/>', 1)
        (tmp_path / "robot.urdf").write_text(urdf)
        paths = (calibration, q_programmed, q_corrected)
        plain = write_preview(tmp_path / "plain.html", *paths, robot_source="ur5")
        meshed = write_preview(tmp_path / "meshed.html", *paths, robot_source=tmp_path / "robot.urdf")
        assert meshed.missing_meshes == ("package://my_robot/meshes/gone.stl",)
        assert "gone.stl" in meshed.output.read_text(encoding="utf-8")
        mesh_bytes = 4 / 3 * (10_242 + 2 * 20_480 / 2) * 12  # vertices and faces in base64, each face three indices
        assert 0 < meshed.output.stat().st_size - plain.output.stat().st_size < 1.3 * mesh_bytes

    def test_of_another_robot_is_refused(self, tmp_path, calibration, q_programmed, q_corrected):
        with pytest.raises(InputError, match="not the robot of the calibration"):
            write_preview(tmp_path / "p.html", calibration, q_programmed, q_corrected, robot_source="ur10")
        assert not (tmp_path / "p.html").exists()
