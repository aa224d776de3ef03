"""The page: plots and words put into the template. It may load nothing, and runs one script, which opens details."""

from __future__ import annotations

import base64
import hashlib
from importlib.resources import files

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from truepath.diagnosis import Diagnosis
from truepath.found_frames import found_frames
from truepath.look import stylesheet
from truepath.report import sections, stage_strip
from truepath.report.distribution import distributions
from truepath.report.drawn import Drawn, Plot
from truepath.report.network import network_card
from truepath.report.residual_plots import over_joints, over_temperature, over_time
from truepath.report.spectrum import spectra
from truepath.report.words import sentence
from truepath.report.workspace import error_vectors


def render(diagnosis: Diagnosis) -> str:
    """The text of ``report.html``; the same for the same diagnosis."""
    drawn = Drawn.of(diagnosis)
    joint_names = diagnosis.calibration.robot.joint_names
    script = _own("page.js")
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    # Nothing may be loaded, and nothing but the one script may run, whatever a file name tries.
    policy = (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"drawing": _drawing, "sentence": sentence}
    return environment.from_string(_own("page.html.jinja")).render(
        policy=policy,
        css=Markup(stylesheet() + _own("page.css")),
        script=Markup(script),
        verdict=diagnosis.verdict,
        facts=sections.facts(diagnosis),
        subtitle=sections.subtitle(diagnosis),
        position_stages=stage_strip.position(diagnosis),
        orientation_stages=stage_strip.orientation(diagnosis),
        distributions=distributions(drawn, diagnosis.unexplained.noise_floor_mm),
        something_found=len(drawn.stages) > 1,
        has_rings=bool(drawn.unseen.any()),
        findings=sections.findings(diagnosis, drawn),
        network=network_card(diagnosis, drawn),
        over_joints=over_joints(drawn, joint_names),
        over_time=over_time(drawn),
        has_clock=drawn.time_s is not None,
        over_temperature=over_temperature(drawn),
        spectra=spectra(drawn, joint_names),
        error_vectors=error_vectors(drawn),
        unexplained=sections.unexplained(diagnosis),
        ambiguous=sections.ambiguous(diagnosis),
        not_testable=sections.not_testable(diagnosis),
        outliers=sections.outliers(diagnosis),
        kinematics=sections.kinematics(diagnosis),
        frames=found_frames(diagnosis.calibration),
        counts=sections.counts(diagnosis),
    )


def _drawing(plot: Plot) -> Markup:
    """The ``svg`` element is made here and holds no text of anybody else but an escaped label."""
    return Markup(plot.svg)


def _own(name: str) -> str:
    return files("truepath.report").joinpath(name).read_text(encoding="utf-8").replace("\r\n", "\n")
