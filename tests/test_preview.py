"""What the preview page promises: it opens anywhere, asks nobody for anything, and shows what the correction does."""

import csv
import io
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hand_made_networks import residual_about
from PIL import Image
from truepath import lie, poe
from truepath.calibration import Calibration
from truepath.calibration_residual import ResidualPart
from truepath.errors import InputError
from truepath.learn import learn
from truepath.measurements import Measurements
from truepath.model import no_deviation, nominal_flange_poses
from truepath.plants import load_robot, models_dir
from truepath.preview import write_preview
from truepath.preview.toolpaths import LINE_LIMIT, Toolpaths, animate, fine_positions, thin_out
from truepath.residual.proof import Proof

CHROMIUM_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
CHROMIUM_OPTIONS = [
    "--no-sandbox",
    "--disable-background-networking",
    "--use-gl=angle",
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--enable-unsafe-swiftshader",
]
SCREEN = {"width": 1366, "height": 768}
PANEL_WIDTH = 345
VERMILLION, BLUE = (0xD5, 0x5E, 0x00), (0x00, 0x72, 0xB2)
UNKIND = "</script><script>document.title='broken'</script> & <b>\"bold\"</b> <!--"


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    """A UR5 that is a millimetre or two off, learnt from 60 noisy poses of a reflector."""
    robot, rng = load_robot("ur5"), np.random.default_rng(0)
    truth = no_deviation(robot)
    truth[: 4 * robot.num_joints] = rng.normal(scale=4e-4, size=4 * robot.num_joints)
    X_MB = lie.make_pose(lie.from_rotation_vector(np.array([0.0, 0.0, 0.3])), np.array([2.0, 1.0, 0.2]))
    X_FE = lie.make_pose(translation=np.array([0.05, 0.0, 0.12]))
    q = rng.uniform([-1.5, -2.2, 0.6, -2.6, -2.4, -1.5], [1.5, -0.6, 2.2, -0.6, -0.8, 1.5], (60, 6))
    p_ME = (X_MB @ poe.flange_poses(robot, truth, q) @ X_FE)[:, :3, 3]
    return learn(robot, Measurements(q_rad=q, p_ME=p_ME + rng.normal(scale=3e-5, size=p_ME.shape)))[0]


@pytest.fixture(scope="module")
def q_programmed() -> np.ndarray:
    with (models_dir() / "ur5" / "weld_path.csv").open() as file:
        return np.array([[float(row[f"q{i}_rad"]) for i in range(1, 7)] for row in csv.DictReader(file)])


@pytest.fixture(scope="module")
def q_corrected(calibration: Calibration, q_programmed: np.ndarray) -> np.ndarray:
    """Two Newton steps towards where the program wants the flange."""
    model, q = calibration.model, q_programmed.copy()
    goal = model.goal_flange_poses(nominal_flange_poses(model.robot, q_programmed))
    for _ in range(2):
        X_BF, J = model.flange_poses_and_jacobian(q)
        q += np.linalg.solve(J, lie.pose_error(goal, X_BF)[..., None])[..., 0]
    return q


@pytest.fixture(scope="module")
def page_file(tmp_path_factory, calibration, q_programmed, q_corrected) -> Path:
    file = tmp_path_factory.mktemp("preview") / "preview.html"
    labels = [f"point <{k}>" for k in range(len(q_programmed))]
    write_preview(file, calibration, q_programmed, q_corrected, robot_source="ur5", title=UNKIND, labels=labels)
    return file


@pytest.fixture(scope="module")
def browser():
    """A headless Chromium that can draw. Without one there is nothing to test, except where CI promises one."""
    executable = next(filter(None, map(shutil.which, CHROMIUM_NAMES)), None)
    if executable is None:
        reason = "no Chromium on this machine: looked for " + ", ".join(CHROMIUM_NAMES)
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=executable, args=CHROMIUM_OPTIONS)
        yield chromium
        chromium.close()


class OpenPage:
    """The page in a browser, with all that it asked for and complained about since it was opened."""

    def __init__(self, browser, file: Path) -> None:
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self.tab = browser.new_page(viewport=SCREEN)
        self.tab.on("request", lambda request: self.requests.append(request.url))
        self.tab.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.tab.on("console", lambda message: message.type in ("error", "warning") and self._note(message))
        self.tab.goto(file.as_uri())
        self.go_to(0.0)  # and stop there: an animation drawn without a graphics card leaves no time for a test

    def _note(self, message) -> None:
        # Chromium remarks on reading pixels back from a software renderer: that is the screenshot's doing.
        if "GPU stall due to ReadPixels" not in message.text:
            self.complaints.append(f"{message.type}: {message.text}")

    def wait_for_picture(self) -> None:
        """Two frames: one may have been drawn before the last change."""
        self.tab.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def scene(self) -> np.ndarray:
        """``(height, width, 3)`` the picture right of the panel."""
        picture = Image.open(io.BytesIO(self.tab.screenshot())).convert("RGB")
        return np.asarray(picture)[:, PANEL_WIDTH:].astype(int)

    def go_to(self, share: float) -> None:
        """Moves the slider, which also stops the animation."""
        self.tab.evaluate(
            "share => { const s = document.getElementById('scrubber'); s.value = share * s.max;"
            " s.dispatchEvent(new Event('input')); }",
            share,
        )
        self.wait_for_picture()


@pytest.fixture(scope="module")
def opened(browser, page_file):
    page = OpenPage(browser, page_file)
    yield page
    page.tab.close()
    assert page.complaints == [], "something that a test did made the page complain"


def pixels_of(colour: tuple[int, int, int], picture: np.ndarray) -> int:
    return int((np.abs(picture - np.array(colour)).max(axis=2) <= 3).sum())


def reddish_purple(picture: np.ndarray) -> int:
    """Pixels in which the colour of faded networks shows through: more red and blue than green."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    return int(((red - green > 30) & (blue - green > 10)).sum())


class TestThePageInABrowser:
    def test_asks_for_nothing_but_itself(self, opened, page_file):
        elsewhere = [url for url in opened.requests if not url.startswith(("data:", "blob:"))]
        assert elsewhere == [page_file.as_uri()]

    def test_makes_no_complaint(self, opened):
        assert opened.complaints == []

    def test_is_not_allowed_to_ask_anybody(self, opened):
        """Not even if some script in it tried."""
        complaints, requests = list(opened.complaints), list(opened.requests)
        refused = """() => new Promise(done => {
            document.addEventListener("securitypolicyviolation", event => done(event.effectiveDirective));
            fetch("https://example.invalid/").catch(() => setTimeout(() => done("allowed"), 10000));
        })"""
        assert opened.tab.evaluate(refused) == "connect-src"
        opened.complaints[:], opened.requests[:] = complaints, requests  # the attempt was ours

    def test_draws_arm_and_paths(self, opened):
        opened.go_to(0.6)
        picture = opened.scene()
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 1000
        assert pixels_of(VERMILLION, picture) > 1000
        assert pixels_of(BLUE, picture) > 1000

    def test_arm_and_paths_fill_the_view(self, opened):
        opened.go_to(0.0)
        picture = opened.scene()
        background = np.median(picture, axis=1, keepdims=True)  # differs from row to row only
        rows, columns = np.nonzero(np.abs(picture - background).max(axis=2) > 60)
        assert np.ptp(rows) > 0.75 * picture.shape[0] or np.ptp(columns) > 0.75 * picture.shape[1]

    def test_moves(self, opened):
        opened.go_to(0.0)
        first = opened.scene()
        assert opened.tab.inner_text("#play") == "Play"
        opened.tab.click("#play")
        opened.tab.wait_for_function("() => Number(document.getElementById('scrubber').value) > 0.8")
        opened.tab.click("#play")
        opened.wait_for_picture()
        changed = np.abs(opened.scene() - first).max(axis=2) > 30
        assert changed.mean() > 0.01

    def test_tells_where_the_arm_is(self, opened):
        opened.go_to(1.0)
        opened.tab.wait_for_function("() => document.getElementById('place').textContent.includes('132 of 132')")
        assert "point <131>" in opened.tab.inner_text("#place")
        assert re.fullmatch(r"Error \d\.\d\d mm → 0\.00 mm", opened.tab.inner_text("#error-here"))

    def test_explains_itself(self, opened):
        panel = opened.tab.inner_text("#panel")
        for text in (
            "Programmed path",
            "Without correction",
            "With correction",
            "error drawn 50 times larger",
            "132 waypoints",
            "Waypoints outside the calibrated region",
            "measured poses that it had not seen",
        ):
            assert text in panel

    def test_shows_foreign_text_as_text(self, opened):
        assert opened.tab.inner_text("h1") == UNKIND
        assert opened.tab.title() == UNKIND

    def test_leaves_the_corner_of_meshcats_controls_free(self, opened):
        panel = opened.tab.locator("#panel").bounding_box()
        controls = opened.tab.locator(".dg.main").bounding_box()
        assert panel["x"] + panel["width"] < controls["x"]

    def test_hides_what_is_unticked(self, opened):
        opened.go_to(0.6)
        before = pixels_of(BLUE, opened.scene())
        box = opened.tab.locator("input[data-nodes='path_corrected']")
        box.uncheck()
        opened.wait_for_picture()
        without = pixels_of(BLUE, opened.scene())
        box.check()
        assert without < 0.5 * before

    def test_without_webgl_still_tells_the_numbers(self, browser, page_file):
        tab = browser.new_page()
        tab.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
        tab.goto(page_file.as_uri())
        assert "no WebGL" in tab.inner_text("#panel")
        assert "Predicted tool" in tab.inner_text("#panel")
        tab.close()


class TestTheFile:
    def test_names_no_address(self, page_file):
        """Save the names of XML name spaces and, within the licences, the homes of those who wrote them."""
        text = re.sub(r"<template>.*?</template>", "", page_file.read_text(encoding="utf-8"), flags=re.DOTALL)
        addresses = set(re.findall(r"https?://[\w./-]+", text))
        assert addresses <= {"http://www.w3.org/1999/xhtml", "http://www.w3.org/2000/svg"}

    def test_is_the_same_for_the_same_input(self, tmp_path, calibration, q_programmed, q_corrected):
        for name in ("a.html", "b.html"):
            write_preview(tmp_path / name, calibration, q_programmed, q_corrected, robot_source="ur5")
        assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()

    def test_stays_small_for_long_paths(self, tmp_path, calibration, q_programmed, q_corrected):
        at, known = np.linspace(0, len(q_programmed) - 1, 20_000), np.arange(len(q_programmed))
        long = [np.stack([np.interp(at, known, joint) for joint in q.T], axis=1) for q in (q_programmed, q_corrected)]
        summary = write_preview(tmp_path / "long.html", calibration, *long, robot_source="ur5")
        assert summary.waypoints == 20_000
        assert summary.key_frames <= 400
        assert summary.output.stat().st_size < 4e6

    def test_needs_neither_drake_nor_torch(self):
        program = "import sys, truepath.preview; print(sorted({'pydrake', 'torch'} & set(sys.modules)))"
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]"


class TestTheSummary:
    def test_agrees_with_the_calibration(self, tmp_path, calibration, q_programmed, q_corrected):
        summary = write_preview(tmp_path / "p.html", calibration, q_programmed, q_corrected, robot_source="ur5")
        model = calibration.model
        goal = model.goal_flange_poses(nominal_flange_poses(model.robot, q_programmed)) @ model.X_FE
        error = (model.flange_poses(q_programmed) @ model.X_FE - goal)[:, :3, 3]
        assert summary.uncorrected_mm.max == pytest.approx(1e3 * np.linalg.norm(error, axis=1).max())
        assert summary.corrected_mm.max < 1e-3
        assert summary.missing_meshes == ()

    def test_counts_waypoints_outside_the_calibrated_region(self, tmp_path, calibration, q_programmed):
        far = q_programmed.copy()
        far[:7, 0] += 2.5
        summary = write_preview(tmp_path / "p.html", calibration, far, far, robot_source="ur5")
        assert summary.outside_region == 7
        assert "7 of 132" in summary.output.read_text(encoding="utf-8")

    def test_chooses_a_round_magnification(self, tmp_path, calibration, q_programmed, q_corrected):
        paths = (q_programmed, q_corrected)
        summary = write_preview(tmp_path / "p.html", calibration, *paths, robot_source="ur5", magnification="auto")
        drawn_m = summary.magnification * summary.uncorrected_mm.p95 / 1e3
        assert summary.magnification in (10, 20, 50, 100, 200)
        assert 0.02 < drawn_m < 0.12

    def test_a_single_waypoint_stands_still(self, tmp_path, calibration, q_programmed, q_corrected):
        one = (q_programmed[:1], q_corrected[:1])
        assert write_preview(tmp_path / "p.html", calibration, *one, robot_source="ur5").key_frames == 1


@pytest.fixture(scope="module")
def with_networks(calibration, q_programmed):
    """The same calibration with networks that know poses about the first third of the path."""
    residual = residual_about(q_programmed[:44].mean(axis=0), half_width_rad=0.2)
    part = ResidualPart.of(residual, Proof(1e-9, 0.05, 0.04))
    return Calibration.model_validate(calibration.model_dump(by_alias=True) | {"residual": part.model_dump()})


@pytest.fixture(scope="module")
def partly(tmp_path_factory, with_networks, q_programmed, q_corrected):
    file = tmp_path_factory.mktemp("networks") / "p.html"
    return write_preview(file, with_networks, q_programmed, q_corrected, robot_source="ur5")


class TestNetworks:
    """Where the neural residual of a calibration is faded, the page shows it; without one it says nothing of it."""

    def test_faded_waypoints_are_counted(self, partly, with_networks, q_corrected):
        weight = with_networks.model.residual.weight(q_corrected)
        faded, silent = int((weight < 1 - 1e-6).sum()), int((weight < 1e-6).sum())
        assert 0 < silent < faded < 132
        text = partly.output.read_text(encoding="utf-8")
        assert f"networks are faded: {faded} of 132, to nothing at {silent}." in text
        assert partly.networks.faded.sum() == faded

    def test_the_spread_is_told(self, partly):
        spread = partly.networks.spoken_mm
        told = f"Spread of the networks: {spread.mean():.3f} mm (mean), {spread.max():.3f} mm (max)"
        assert told in partly.output.read_text(encoding="utf-8")

    def test_they_are_drawn_in_a_colour_of_their_own_that_can_be_hidden(self, browser, partly):
        page = OpenPage(browser, partly.output)
        drawn = reddish_purple(page.scene())
        page.tab.locator("input[data-nodes='path_faded']").uncheck()
        page.wait_for_picture()
        assert drawn > 300
        assert reddish_purple(page.scene()) < 0.1 * drawn
        assert page.complaints == []
        page.tab.close()

    def test_where_they_are_nowhere_faded_nothing_is_drawn(self, tmp_path, with_networks, q_programmed):
        known = np.tile(q_programmed[:44].mean(axis=0), (3, 1))
        summary = write_preview(tmp_path / "p.html", with_networks, known, known, robot_source="ur5")
        text = summary.output.read_text(encoding="utf-8")
        assert "networks are faded: none of 3" in text
        assert "path_faded" not in text

    def test_where_they_are_silent_no_spread_is_told(self, tmp_path, with_networks, q_programmed):
        far = q_programmed + np.array([2.0, 0, 0, 0, 0, 0])
        text = write_preview(tmp_path / "p.html", with_networks, far, far, robot_source="ur5").output.read_text()
        assert "networks are faded: 132 of 132, to nothing at 132" in text
        assert "Spread of" not in text

    def test_without_networks_the_page_says_nothing_of_them(self, page_file):
        text = re.sub(r"<script>.*?</script>|<template>.*?</template>", "", page_file.read_text(), flags=re.DOTALL)
        assert "etworks" not in text


class TestTheArm:
    def test_has_its_tool_on_the_drawn_line(self, calibration, q_programmed, q_corrected):
        model = calibration.model
        frames = animate(model, q_programmed, q_corrected, magnification=50.0)
        known = np.arange(len(q_programmed))
        at = [np.stack([np.interp(frames.waypoint, known, j) for j in q.T], 1) for q in (q_programmed, q_corrected)]
        drawn = Toolpaths.of(model, *at).magnified(50.0)
        for q, points in ((frames.q_uncorrected, drawn.uncorrected), (frames.q_corrected, drawn.corrected)):
            tool = (nominal_flange_poses(model.robot, q) @ model.X_FE)[:, :3, 3]
            np.testing.assert_allclose(tool, points, atol=1e-4)

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


class TestTheLines:
    def test_keep_their_corners_when_thinned_out(self):
        along = np.linspace(0.0, 1.0, 50_001)[:, None]
        corner, end = np.array([0.3, 0.7, 0.0]), np.array([1.0, 0.0, 0.0])
        points = np.concatenate([along * corner, corner + along[1:] * (end - corner)])
        kept = thin_out(points)
        assert len(kept) <= LINE_LIMIT
        assert {0, 50_000, 100_000} <= set(kept.tolist())

    def test_show_the_arc_between_distant_waypoints(self):
        position = fine_positions(np.array([[0.0, 0.0], [1.0, 0.2], [1.0, 0.2]]))
        assert {0.0, 1.0, 2.0} <= set(position.tolist())
        assert 15 < len(position) < 30


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (dict(q_corrected=np.zeros((3, 6))), "differ in length"),
        (dict(q_programmed=np.zeros((0, 6)), q_corrected=np.zeros((0, 6))), "one waypoint or more"),
        (dict(q_programmed=np.full((132, 6), np.nan)), "waypoint 1"),
        (dict(q_programmed=np.zeros((132, 7))), "6 joints each"),
        (dict(magnification=0.0), "this scale"),
        (dict(magnification=float("nan")), "this scale"),
        (dict(labels=["one"]), "labels and waypoints"),
        (dict(robot_source="no_such_robot"), "no robot"),
    ],
)
def test_refuses_what_makes_no_sense(tmp_path, calibration, q_programmed, q_corrected, change, message):
    given = dict(q_programmed=q_programmed, q_corrected=q_corrected, robot_source="ur5") | change
    with pytest.raises(InputError, match=message):
        write_preview(tmp_path / "p.html", calibration, **given)
    assert list(tmp_path.iterdir()) == []
