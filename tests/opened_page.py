"""A preview in a real browser."""

import io
from pathlib import Path

import numpy as np
from PIL import Image

LAPTOP, DESKTOP, PHONE = (dict(width=w, height=h) for w, h in ((1366, 768), (1920, 1080), (390, 844)))
SMALL = dict(width=900, height=500)  # drawn by the processor: every pixel counts
VERMILLION, BLUE = (0xD5, 0x5E, 0x00), (0x00, 0x72, 0xB2)
UNKIND = "</script><script>document.title='broken'</script> & <b>\"bold\"</b> <!--"
# Reading a pixel waits until the picture is really drawn.
TIME_OF_THE_FIRST_PICTURE = """new MutationObserver(() => {
    if (document.body?.dataset.ready === undefined || window.first_picture_ms) return;
    const canvas = document.querySelector("#meshcat-pane canvas");
    const gl = canvas.getContext("webgl2") || canvas.getContext("webgl");
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    window.first_picture_ms = performance.now();
}).observe(document, { subtree: true, childList: true, attributes: true });"""
HIDE_WHAT_LIES_OVER = "#scale, #views { visibility: hidden; }"


class OpenPage:
    """The page in a browser, with all that it asked for and complained about since it was opened."""

    def __init__(self, browser, file: Path, screen: dict[str, int] = SMALL) -> None:
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self.tab = browser.new_page(viewport=screen)
        self.tab.on("request", lambda request: self.requests.append(request.url))
        self.tab.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.tab.on("console", lambda message: message.type in ("error", "warning") and self._note(message))
        self.tab.add_init_script(TIME_OF_THE_FIRST_PICTURE)
        self.tab.goto(file.as_uri())
        self.tab.wait_for_selector("body[data-ready]", state="attached")
        self.go_to(0.0)  # and stop there: an animation drawn without a graphics card leaves no time for a test

    def _note(self, message) -> None:
        # Chromium remarks on reading pixels back from a software renderer: that is the screenshot's doing.
        if "GPU stall due to ReadPixels" not in message.text:
            self.complaints.append(f"{message.type}: {message.text}")

    def ready_after_s(self) -> float:
        """From the start of the navigation to the first picture with everything in it."""
        return self.tab.evaluate("() => window.first_picture_ms") / 1e3

    def wait_for_picture(self) -> None:
        """Two frames: one may have been drawn before the last change."""
        self.tab.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def scene(self) -> np.ndarray:
        """``(height, width, 3)`` the picture without what lies over it."""
        self.wait_for_picture()
        png = self.tab.locator("#meshcat-pane").screenshot(style=HIDE_WHAT_LIES_OVER)
        return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)

    def go_to(self, share: float) -> None:
        """Moves the slider, which also stops the animation."""
        self.tab.evaluate(
            "share => { const s = document.getElementById('scrubber'); s.value = 1 + share * (s.max - 1);"
            " s.dispatchEvent(new Event('input')); }",
            share,
        )
        self.wait_for_picture()

    def place(self) -> str:
        return self.tab.inner_text("#place")


def pixels_of(colour: tuple[int, int, int], picture: np.ndarray) -> int:
    return int((np.abs(picture - np.array(colour)).max(axis=2) <= 3).sum())


def changed(one: np.ndarray, other: np.ndarray) -> float:
    """Share of the pixels that differ clearly."""
    return float((np.abs(one - other).max(axis=2) > 30).mean())
