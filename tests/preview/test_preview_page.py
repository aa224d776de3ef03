"""The preview page in a real browser: it opens, draws, moves, obeys its controls, and asks nobody for anything."""

import base64
import io
import re

import numpy as np
import pytest
from opened_page import BLUE, DESKTOP, LAPTOP, PHONE, SMALL, UNKIND, VERMILLION, OpenPage, changed, pixels_of
from PIL import Image


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
        assert pixels_of(VERMILLION, picture) > 100
        assert pixels_of(BLUE, picture) > 300

    def test_moves(self, opened):
        opened.go_to(0.0)
        first = opened.scene()
        assert opened.tab.inner_text("#play") == "Play"
        opened.tab.click("#play")
        opened.tab.wait_for_function("() => Number(document.getElementById('scrubber').value) > 20")
        assert opened.tab.inner_text("#play") == "Pause"
        opened.tab.click("#play")
        opened.tab.wait_for_function("() => document.getElementById('play').textContent === 'Play'")
        assert changed(opened.scene(), first) > 0.01

    def test_steps_from_waypoint_to_waypoint(self, opened):
        opened.go_to(0.0)
        assert opened.place() == "Waypoint 1 of 132"
        for _ in range(3):
            opened.tab.click("#next")
        assert opened.place() == "Waypoint 4 of 132"
        opened.tab.click("#before")
        assert opened.place() == "Waypoint 3 of 132"
        assert float(opened.tab.input_value("#scrubber")) == pytest.approx(3.0)

    def test_tells_where_the_arm_is(self, opened):
        opened.go_to(1.0)
        assert opened.place() == "Waypoint 132 of 132"
        assert opened.tab.inner_text("#statement") == "point <131>"
        assert re.fullmatch(r"Error \d\.\d\d mm → 0\.0\d mm expected", opened.tab.inner_text("#error-here"))

    def test_explains_itself(self, opened):
        panel = opened.tab.inner_text("#panel")
        for text in (
            "Programmed path",
            "Path without correction",
            "Path with correction",
            "Robot without correction",
            "Tool frames",
            "Calibrated region",
            "132 waypoints",
            "Waypoints outside the calibrated region",
            "measured poses that the fit had not seen",
            "Solver: the corrected joints meet the calibrated model to < 0.001 mm",
        ):
            assert text in panel

    def test_states_magnification_and_scale_in_the_scene(self, opened):
        scale = opened.tab.inner_text("#stage #scale")
        assert "Errors drawn 50 times larger" in scale
        assert "Error without correction, mm" in scale
        ticks = [float(tick) for tick in opened.tab.locator("#colour-bar .ticks span").all_inner_texts()]
        assert ticks[0] == 0
        np.testing.assert_allclose(np.diff(ticks), ticks[1], rtol=0.02)
        worst = float(opened.tab.locator("tbody td").nth(1).inner_text())
        assert worst <= ticks[-1] <= 2.5 * worst

    def test_shows_foreign_text_as_text(self, opened):
        assert opened.tab.inner_text("h1") == UNKIND
        assert opened.tab.title() == UNKIND

    @pytest.mark.parametrize(
        "layer",
        [
            "path_programmed",
            "path_uncorrected",
            "path_corrected",
            "error_arrows",
            "arm_corrected",
            "arm_uncorrected",
            "tool_frames",
            "region_covered",
        ],
    )
    def test_hides_and_shows_each_layer(self, opened, layer):
        opened.go_to(0.6)
        opened.tab.click("[data-view=path]")
        box = opened.tab.locator(f"input[data-nodes='{layer}']")
        before = opened.scene()
        box.click()
        without = opened.scene()
        box.click()
        opened.tab.click("[data-view=arm]")
        assert changed(without, before) > 0.0005

    def test_colours_by_error_or_not(self, opened):
        opened.go_to(0.6)
        opened.tab.uncheck("#by-error")
        plain = pixels_of(VERMILLION, opened.scene())
        assert not opened.tab.is_visible("#colour-bar")
        opened.tab.check("#by-error")
        assert opened.tab.is_visible("#colour-bar")
        assert pixels_of(VERMILLION, opened.scene()) < 0.7 * plain

    def test_looks_from_where_it_is_asked(self, opened):
        opened.go_to(0.6)
        pictures = []
        for view in ("path", "above", "arm"):
            opened.tab.click(f"[data-view={view}]")
            pictures.append(opened.scene())
        assert changed(pictures[0], pictures[1]) > 0.1
        assert changed(pictures[1], pictures[2]) > 0.1

    def test_is_printed_with_a_picture(self, opened):
        """Chromium tells pages that it prints; what was a canvas is then an image."""
        opened.tab.set_viewport_size(LAPTOP)  # of a smaller picture too much is edges, which are smoothed in between
        opened.go_to(0.6)
        on_screen = opened.scene()
        opened.tab.evaluate(
            "() => addEventListener('beforeprint', () => { window.printed = document.getElementById('picture').src; })"
        )
        pdf = opened.tab.pdf(prefer_css_page_size=True)
        assert pdf.startswith(b"%PDF")
        assert b"/Image" in pdf
        uri = opened.tab.evaluate("() => window.printed")
        picture = Image.open(io.BytesIO(base64.b64decode(uri.split(",")[1]))).convert("RGB")
        printed = np.asarray(picture.resize(on_screen.shape[1::-1])).astype(int)
        assert changed(printed, on_screen) < 0.02
        assert not opened.tab.is_visible("#picture")
        opened.tab.set_viewport_size(SMALL)

    def test_without_webgl_still_tells_the_numbers(self, browser, page_file):
        tab = browser.new_page()
        tab.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
        tab.goto(page_file.as_uri())
        assert "no WebGL" in tab.inner_text("#panel")
        assert "Error of the tool, mm" in tab.inner_text("#panel")
        tab.close()


@pytest.fixture(scope="module", params=[LAPTOP, DESKTOP, PHONE], ids=["laptop", "desktop", "phone"])
def sized(request, browser, page_file):
    page = OpenPage(browser, page_file, request.param)
    yield page
    page.tab.close()
    assert page.complaints == []


class TestEachScreen:
    def test_arm_and_paths_fill_the_view(self, sized):
        picture = sized.scene()
        background = np.median(picture, axis=1, keepdims=True)  # differs from row to row only
        rows, columns = np.nonzero(np.abs(picture - background).max(axis=2) > 60)
        assert np.ptp(rows) > 0.7 * picture.shape[0] or np.ptp(columns) > 0.7 * picture.shape[1]
        assert picture.std() > 10

    def test_nothing_is_wider_than_the_screen(self, sized):
        assert sized.tab.evaluate("() => document.documentElement.scrollWidth - innerWidth") <= 0

    def test_nothing_lies_over_something_else(self, sized):
        boxes = [sized.tab.locator(name).bounding_box() for name in ("#scale", "#views", "#playback", "h1")]
        for k, a in enumerate(boxes):
            for b in boxes[k + 1 :]:
                apart = (
                    a["x"] + a["width"] <= b["x"]
                    or b["x"] + b["width"] <= a["x"]
                    or a["y"] + a["height"] <= b["y"]
                    or b["y"] + b["height"] <= a["y"]
                )
                assert apart, (a, b)

    def test_no_text_is_tiny(self, sized):
        sizes = sized.tab.evaluate(
            "() => [...document.querySelectorAll('#panel *, #scale *, #playback *')]"
            ".filter(e => [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim()))"
            ".map(e => parseFloat(getComputedStyle(e).fontSize))"
        )
        assert len(sizes) > 20
        assert min(sizes) >= 12
