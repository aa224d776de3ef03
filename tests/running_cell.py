"""The reference host as a process, and its address in a browser."""

import io
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
from PIL import Image

WORKFLOW = Path(__file__).parents[1] / "workflows" / "cell.py"
SCREEN = {"width": 900, "height": 500}  # drawn by the processor: every pixel counts
PATIENCE_S = 90.0
WRIST = "['truepath', 'ur5', '{arm}', 'ur5', 'wrist_3_link']"
CORNERS_ON_SCREEN = """() => {
    const found = [];
    const camera = viewer.camera;
    camera.updateMatrixWorld(true);
    viewer.scene_tree.find(["Cameras", "default", "rotated", "<object>"]).object.traverse(node => {
        if (!node.isMesh || !node.geometry.attributes.uv) return;
        for (let at = node; at; at = at.parent) if (!at.visible) return;
        const place = node.geometry.attributes.position;
        for (let k = 0; k < place.count; k += 1) {
            const corner = camera.position.clone().fromBufferAttribute(place, k);
            const { x, y } = node.localToWorld(corner).project(camera);
            found.push([x, y]);
        }
    });
    return found;
}"""  # of all panes that are visible, from -1 to 1


class Running:
    """The host as a process."""

    def __init__(self, *arguments):
        command = [sys.executable, str(WORKFLOW), *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.lines = []
        watch = threading.Timer(PATIENCE_S, self.process.kill)
        watch.daemon = True
        watch.start()

    def read_until(self, start):
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))
            if line.startswith(start):
                return self
        raise AssertionError("ended too early: " + "\n".join(self.lines))

    @property
    def address(self):
        return re.search(r"http://\S+", self.lines[0])[0]

    def interrupt(self):
        """Ctrl-C; gives the exit code and what was said since."""
        self.process.send_signal(signal.SIGINT)
        rest = self.process.stdout.read()
        return self.process.wait(20), rest


class Tab:
    """The address in a browser, and all that it complained about."""

    def __init__(self, browser, address):
        self.complaints, self.requests = [], []
        self.page = browser.new_page(viewport=SCREEN)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", lambda message: message.type == "error" and self.complaints.append(message.text))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(address)
        self.page.wait_for_function(f"() => {self.node('arm_corrected')}.object.children.length > 0")

    @staticmethod
    def node(arm):
        return f"viewer.scene_tree.find({WRIST.format(arm=arm)})"

    def wrist(self, arm):
        """``(3,)`` where the last link of an arm is, as the browser has it."""
        return np.array(self.page.evaluate(f"() => {self.node(arm)}.object.position.toArray()"))

    def wait_until_moved(self, arm, before):
        x, y, z = before.tolist()
        self.page.wait_for_function(
            f"() => {{ const p = {self.node(arm)}.object.position;"
            f" return Math.hypot(p.x - {x}, p.y - {y}, p.z - {z}) > 1e-4; }}"
        )

    def is_visible(self, part):
        return self.page.evaluate(f"() => viewer.scene_tree.find(['truepath', 'ur5', '{part}']).object.visible")

    def picture(self):
        return np.asarray(Image.open(io.BytesIO(self.page.screenshot())).convert("RGB")).astype(int)
