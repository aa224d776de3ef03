"""The HTML page around the scene: legend, numbers, playback. One file, and a policy that forbids it any request."""

from __future__ import annotations

import base64
import hashlib
import json
import math
from dataclasses import dataclass
from html import escape
from importlib.resources import files

import numpy as np
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from truepath.expected import NOT_KNOWN, ExpectedError
from truepath.iso9283 import ErrorStatistics
from truepath.lie import Array
from truepath.look import stylesheet
from truepath.networks_along import NetworksAlong
from truepath.preview import colours, scene
from truepath.preview.figures import in_mm
from truepath.preview.keyframes import KeyFrames
from truepath.preview.payload import payload
from truepath.preview.recorded import RecordedScene
from truepath.preview.shown import Remark, ShownPath

MOST_REMARKS = 300
SCRIPTS = ("camera.js", "playback.js", "page.js")


@dataclass(frozen=True)
class PageText:
    """What the panel says.

    Attributes:
        title, robot, calibrated_utc: any text; it is escaped.
        waypoints, outside: how many there are, and how many lie outside the calibrated region.
        magnification: factor by which errors are drawn.
        scale_mm: error at the end of the colour bar.
        tool: whose paths these are.
        base_mm: ``(3,)`` where the robot's base is in the world, mm.
        uncorrected, corrected: predicted errors at the waypoints, mm.
        expected: what remains to be expected on the robot with the correction.
        missing_meshes: what could not be drawn.
        networks: what they say at the waypoints; None where the calibration has none.
        remarks: what to look at.
        has_region: whether the calibrated region is drawn.
        report: page beside this one that says what is wrong with the robot; None: there is none.
    """

    title: str
    robot: str
    calibrated_utc: str
    waypoints: int
    outside: int
    magnification: float
    scale_mm: float
    tool: str
    base_mm: Array
    uncorrected: ErrorStatistics
    corrected: ErrorStatistics
    expected: ExpectedError
    missing_meshes: tuple[str, ...]
    networks: NetworksAlong | None
    remarks: tuple[Remark, ...]
    has_region: bool
    report: str | None = None


def render(text: PageText, shown: ShownPath, outside: Array, recorded: RecordedScene, frames: KeyFrames) -> str:
    """The page.

    Args:
        text: what the panel says.
        shown: the path, for lines and texts of its waypoints.
        outside: ``(T,)`` True for waypoints outside the calibrated region.
        recorded: what is to be seen.
        frames: the animation.
    """
    own = _as_script("\n".join(_read(name) for name in SCRIPTS))
    scripts = [_meshcat("viewer/dist/main.min.js"), f'"use strict";\n(() => {{\n{own}}})();\n']
    # Only these two scripts may run and nothing may be loaded: not even text that escaped escaping could change that.
    hashes = " ".join(f"'sha256-{_sha256(script)}'" for script in scripts)
    policy = (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )
    larger = "" if text.magnification == 1 else f"errors drawn {text.magnification:g} times larger"
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["mm"] = in_mm
    return environment.from_string(_read("page.html.jinja")).render(
        policy=policy,
        css=Markup(stylesheet() + _read("page.css")),
        scripts=[Markup(script) for script in scripts],
        data=Markup(payload(shown, outside, text.expected.known_mm, recorded, frames)),
        licences=Markup(_licences()),
        text=text,
        expected=text.expected.known_mm,
        not_known=NOT_KNOWN,
        drawn=larger or "errors drawn in true size",
        gradient=", ".join(colours.ERROR_SCALE),
        ticks=_ticks(text.scale_mm),
        colours=colours,
        scene=scene,
        remarks=text.remarks[:MOST_REMARKS],
        remark_count=len(text.remarks),
        has_region=text.has_region,
        notes=_notes(text),
    )


def _notes(text: PageText) -> list[tuple[str, str]]:
    """CSS class and text of what must be said below the numbers."""
    where = "Waypoints outside the calibrated region"
    if text.outside:
        beyond = f"{where}: {text.outside} of {text.waypoints}. There the errors are extrapolated."
        notes = [(" warning", beyond)]
    else:
        notes = [("", f"{where}: none of {text.waypoints}.")]
    if text.networks is not None:
        notes += _network_notes(text.networks)
    notes.append(
        ("" if text.expected.known_mm is not None else " warning", f"Expected with correction: {text.expected.source}.")
    )
    notes.append(("", "Without correction: as the calibrated model predicts."))
    exact = in_mm(text.corrected.max)
    is_solved = f"to {exact} mm" if exact.startswith("<") else f"within {exact} mm"
    notes.append(("", f"Solver: the corrected joints meet the calibrated model {is_solved}. That is no accuracy."))
    base = ", ".join(f"{value + 0.0:.0f}" for value in np.round(text.base_mm))
    grid = f"Grid 100 mm, level. The large axes are the robot base frame, at ({base}) mm in the world"
    notes.append(("", f"Paths are those of {text.tool}. {grid}."))
    if text.missing_meshes:
        notes.append((" warning", "Not drawn, file not readable: " + ", ".join(text.missing_meshes)))
    return notes


def _network_notes(networks: NetworksAlong) -> list[tuple[str, str]]:
    total, faded, silent = len(networks.weight), int(networks.faded.sum()), int(networks.silent.sum())
    where = "Waypoints where the networks are faded"
    if not faded:
        notes = [("", f"{where}: none of {total}.")]
    else:
        how = f"{where}: {faded} of {total}" + (f", to nothing at {silent}" if silent else "")
        notes = [(" warning", f"{how}. There what only they know is {networks.corrected}.")]
    if silent < total:
        spread = networks.spoken_mm
        notes.append(("", f"Spread of the networks: {spread.mean():.3f} mm (mean), {spread.max():.3f} mm (max)."))
    return notes


def _licences() -> str:
    """What the licences of meshcat's viewer and of the libraries in it want to travel with them."""
    libraries = json.loads(_meshcat("viewer/dist/main.min.js.THIRD_PARTY_LICENSES.json"))
    texts = [f"{library['name']}: {library['license']}\n{library['licenseText'] or ''}" for library in libraries]
    return "".join(f"<pre>{escape(text)}</pre>" for text in (_meshcat("viewer/LICENSE"), *texts))


def _meshcat(path: str) -> str:
    return _as_script(files("meshcat").joinpath(path).read_text(encoding="utf-8"))


def _read(name: str) -> str:
    return files("truepath.preview").joinpath(name).read_text(encoding="utf-8")


def _as_script(source: str) -> str:
    """The same program, unable to end its script element early; with the line ends that a browser hashes."""
    return source.replace("\r\n", "\n").replace("\r", "\n").replace("</script", "<\\/script")


def _sha256(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


def _ticks(scale_mm: float) -> list[str]:
    """Numbers below the colour bar, all with the same digits."""
    digits = max(0, 2 - math.floor(math.log10(0.25 * scale_mm))) if scale_mm > 0 else 0
    return ["0", *(f"{share * scale_mm:.{digits}f}" for share in (0.25, 0.5, 0.75, 1.0))]
