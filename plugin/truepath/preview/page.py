"""The HTML page around the scene: legend, numbers, playback. One file, and a policy that forbids it any request."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from truepath.calibration_parts import StatisticsPart
from truepath.iso9283 import ErrorStatistics
from truepath.networks_along import NetworksAlong
from truepath.preview import scene
from truepath.preview.toolpaths import KeyFrames


@dataclass(frozen=True)
class PageText:
    """What the panel says.

    Attributes:
        title, robot, calibrated_utc: any text; it is escaped.
        waypoints, outside: how many there are, and how many lie outside the calibrated region.
        magnification: factor by which errors are drawn.
        uncorrected, corrected: predicted errors at the waypoints, mm.
        model_error: errors of the calibrated model itself on poses it had not seen, mm; None if unknown.
        missing_meshes: what could not be drawn.
        networks: what they say at the waypoints; None where the calibration has none.
    """

    title: str
    robot: str
    calibrated_utc: str
    waypoints: int
    outside: int
    magnification: float
    uncorrected: ErrorStatistics
    corrected: ErrorStatistics
    model_error: StatisticsPart | None
    missing_meshes: tuple[str, ...]
    networks: NetworksAlong | None = None


def render(text: PageText, recorded: scene.RecordedScene, frames: KeyFrames, labels: Sequence[str] | None) -> str:
    """The page.

    Args:
        text: what the panel says.
        recorded: what is to be seen.
        frames: the animation, for the numbers shown along with it.
        labels: names of the waypoints.
    """
    scripts = [_meshcat("viewer/dist/main.min.js"), _own("page.js")]
    # Only these two scripts may run and nothing may be loaded: not even text that escaped escaping could change that.
    hashes = " ".join(f"'sha256-{_sha256(script)}'" for script in scripts)
    policy = (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(text.title)}</title>",
            f"<style>{_own('page.css')}</style>",
            "</head>",
            "<body>",
            '<div id="meshcat-pane"></div>',
            _panel(text),
            f'<script type="application/json" id="scene-data">{_data(text, recorded, frames, labels)}</script>',
            f"<template>{_licences()}</template>",
            *(f"<script>{script}</script>" for script in scripts),
            "</body>",
            "</html>",
            "",
        ]
    )


def _panel(text: PageText) -> str:
    factor = f"{text.magnification:g}"
    facts = (text.robot, _count(text.waypoints, "waypoint"), f"calibrated {text.calibrated_utc[:10]}")
    subtitle = " · ".join(f"<span>{escape(fact)}</span>" for fact in facts)
    drawn = f"error drawn {factor} times larger" if text.magnification != 1 else "error drawn in true size"
    legend = [
        _entry(
            "band", scene.PROGRAMMED, 0.5, "Programmed path", "where the program wants the tool", scene.PATH_PROGRAMMED
        ),
        _entry("swatch", scene.UNCORRECTED, 1, "Without correction", drawn, scene.PATH_UNCORRECTED, scene.ERROR_LINES),
        _entry("swatch", scene.CORRECTED, 1, "With correction", drawn, scene.PATH_CORRECTED),
        _entry("arm", "#c9cdd2", 1, "Robot on the corrected path", "", scene.ARM),
        _entry("arm", scene.UNCORRECTED, 0.35, "Robot without correction", drawn, scene.GHOST),
    ]
    if text.networks is not None and text.networks.faded.any():
        name, how = "Networks faded", "the wider, the less they correct"
        legend.insert(1, _entry("sleeve", scene.FADED, 0.75, name, how, scene.PATH_FADED))
    if text.outside:
        swatch = f'<span class="band" style="background:{scene.OUTSIDE};opacity:.6"></span>'
        legend.insert(1, f"<li><label>{swatch}<span>Outside the calibrated region</span></label></li>")
    errors = (("mean", text.uncorrected.mean, text.corrected.mean), ("max", text.uncorrected.max, text.corrected.max))
    rows = "".join(f"<tr><td>{name}</td><td>{a:.3f}</td><td>{b:.3f}</td></tr>" for name, a, b in errors)
    return f"""<main id="panel">
<h1>{escape(text.title)}</h1>
<p class="subtitle">{subtitle}</p>
<p id="no-webgl" class="warning" hidden>No 3D view: this browser has no WebGL. The numbers below hold all the same.</p>
<noscript><p class="warning">The 3D view needs JavaScript. The numbers below hold all the same.</p></noscript>
<ul class="legend">
{"".join(legend)}
</ul>
<table>
<thead><tr><th>Predicted tool<br>error, mm</th><th>without<br>correction</th><th>with<br>correction</th></tr></thead>
<tbody>{rows}</tbody>
</table>
<div id="playback">
<button id="play" type="button">Pause</button>
<input id="scrubber" type="range" min="0" max="1" step="any" value="0" aria-label="Time">
<div id="readout"><span id="place"></span><span id="error-here"></span></div>
</div>
{"".join(f'<p class="note{kind}">{escape(note)}</p>' for kind, note in _notes(text))}
</main>"""


def _entry(shape: str, colour: str, opacity: float, name: str, explanation: str, *nodes: str) -> str:
    small = f"<small>{escape(explanation)}</small>" if explanation else ""
    return (
        f'<li><label><span class="{shape}" style="background:{colour};opacity:{opacity:g}"></span>'
        f"<span>{escape(name)}{small}</span>"
        f'<input type="checkbox" checked data-nodes="{" ".join(nodes)}"></label></li>\n'
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
    predicted = "Errors are what the calibrated model predicts."
    if text.model_error is not None:
        predicted += (
            f" The model itself was off by {text.model_error.mean:.3f} mm (mean) and "
            f"{text.model_error.max:.3f} mm (max) on measured poses that it had not seen."
        )
    notes.append(("", predicted))
    notes.append(("", "Robot base frame: x red, y green, z blue. Grid 100 mm."))
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


def _data(text: PageText, recorded: scene.RecordedScene, frames: KeyFrames, labels: Sequence[str] | None) -> str:
    waypoint = np.round(frames.waypoint + 1, 2)
    passed = np.unique(np.round(waypoint).astype(int))
    content: dict[str, Any] = {
        "root": scene.ROOT,
        "waypoints": text.waypoints,
        "chunks": [base64.b64encode(chunk).decode("ascii") for chunk in recorded.chunks],
        "commands": recorded.commands,
        "view": {"points": recorded.view_points.round(4).tolist(), "direction": recorded.view_direction.tolist()},
        "frames": {
            "time_s": frames.time_s.round(4).tolist(),
            "waypoint": waypoint.tolist(),
            "uncorrected_mm": frames.error_uncorrected_mm.round(4).tolist(),
            "corrected_mm": frames.error_corrected_mm.round(4).tolist(),
            "labels": {} if labels is None else {int(k - 1): str(labels[k - 1]) for k in passed},
        },
    }
    # Within a script element nothing but its end tag (and a comment that hides it) can do harm: no "<" at all.
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _licences() -> str:
    """What the licences of meshcat's viewer and of the libraries in it want to travel with them."""
    libraries = json.loads(_meshcat("viewer/dist/main.min.js.THIRD_PARTY_LICENSES.json"))
    texts = [f"{library['name']}: {library['license']}\n{library['licenseText'] or ''}" for library in libraries]
    return "".join(f"<pre>{escape(text)}</pre>" for text in (_meshcat("viewer/LICENSE"), *texts))


def _meshcat(path: str) -> str:
    return _as_script(files("meshcat").joinpath(path).read_text(encoding="utf-8"))


def _own(name: str) -> str:
    return _as_script(files("truepath.preview").joinpath(name).read_text(encoding="utf-8"))


def _as_script(source: str) -> str:
    """The same program, unable to end its script element early; with the line ends that a browser hashes."""
    return source.replace("\r\n", "\n").replace("\r", "\n").replace("</script", "<\\/script")


def _sha256(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")
