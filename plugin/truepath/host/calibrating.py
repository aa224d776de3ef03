"""The half of the plugin that learns: from measured poses in memory or in a file to a calibration in use."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from truepath.calibration import Calibration, load_calibration
from truepath.calibration_parts import RobotPart
from truepath.errors import InputError
from truepath.host.arm_in_plant import ArmInPlant
from truepath.host.in_memory import MeasuredIn, Probe, as_measurements, stated_base, stated_probe
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.plants import BUILT_IN, HOSTS_PLANT, load_plant
from truepath.robot import NominalRobot, read_robot
from truepath.same_robot import require_same_robot

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant

    from truepath.diagnosis import Diagnosis
    from truepath.residual.options import Options

Progress = Callable[[str], None]
FROM_THE_HOST = (
    "lower_rad",
    "upper_rad",
    "velocity_rad_s",
    "acceleration_rad_s2",
    "gravity_m_s2",
    "world_base",
)
NAMES = ("name", "source", "joint_names")


class Calibrating:
    """An arm in a host's plant, and the calibration of it that is in use.

    Args:
        place: the arm.
    """

    def __init__(self, place: ArmInPlant) -> None:
        self.place = place
        self.source = HOSTS_PLANT
        self._calibration: Calibration | None = None

    @property
    def plant(self) -> MultibodyPlant:
        """The host's plant."""
        return self.place.plant

    @property
    def robot(self) -> NominalRobot:
        """The arm as the plant has it."""
        return self.place.robot

    @property
    def calibration(self) -> Calibration | None:
        """The calibration in use; None before ``calibrate``, ``load`` or ``use``."""
        return self._calibration

    def name_source(self, robot_source: str | Path) -> None:
        """Says which file holds the arm: a built-in name, a URDF or directives. Calibrations saved from now on name it.

        Raises:
            InputError: no such file, none with these joints in it, or an arm of another geometry.
        """
        from truepath.model_files import find_urdf

        urdf = find_urdf(robot_source, self.robot.joint_names, self.robot.name)
        self._require_geometry(urdf)
        is_built_in = str(robot_source) in BUILT_IN
        self.source = str(robot_source) if is_built_in else str(Path(robot_source).resolve())
        if self._calibration is not None:
            self.use(self._calibration)

    def _require_geometry(self, urdf: Path) -> None:
        """Refuses a file whose arm is another one; its end does not count if it has no frame of that name."""
        plant, arm = load_plant(urdf), self.place.arm
        joints = [plant.GetJointByName(name) for name in self.robot.joint_names]
        has_flange = plant.HasFrameNamed(arm.flange.name())
        end = arm.flange.name() if has_flange else joints[-1].child_body().name()
        base = arm.base.name() if plant.HasFrameNamed(arm.base.name()) else None
        given = read_robot(plant, base_frame=base, flange_frame=end)
        if not has_flange:
            given = replace(given, X_BF=self.robot.X_BF)
        require_same_robot(self.robot, given, "the source holds another robot than this arm", urdf)

    @property
    def arm(self) -> Array:
        """``(n,)`` where the arm's joints are among the positions of the plant: ``q[plugin.arm]``."""
        return self.place.positions.copy()

    def measurements(
        self,
        q_rad: Array,
        positions_m: Array,
        rotations: Array | None = None,
        *,
        measured_in: MeasuredIn = "world",
        probe: Probe | None = None,
        time_s: Array | None = None,
        temperature_c: Array | None = None,
        payload_kg: Array | None = None,
        approach: Array | None = None,
        pose_id: Array | None = None,
    ) -> Measurements:
        """Measured poses out of memory.

        Args:
            q_rad: ``(N, n)`` commanded joints of the arm, in the order of measurement.
            positions_m: ``(N, 3)`` where the probe was.
            rotations: ``(N, 3, 3)`` how it stood, if that was measured.
            measured_in: ``world``, the host's; ``tracker``, a frame that stands anywhere.
            probe: ``tool``, it sits at the tool frame; ``unknown``, somewhere on the flange; ``(3,)`` or ``(4, 4)``,
                there on the flange. None: at the tool frame if the plugin has one, else unknown.
            time_s, temperature_c, payload_kg, approach, pose_id: as ``Measurements`` has them.

        Raises:
            InputError: shapes that do not fit, no numbers, angles beyond the joints' limits.
        """
        circumstances = {
            "time_s": time_s,
            "temperature_c": temperature_c,
            "payload_kg": payload_kg,
            "approach": approach,
            "pose_id": pose_id,
        }
        return as_measurements(self.place, q_rad, positions_m, rotations, measured_in, probe, circumstances)

    def read_measurements(
        self, path: str | Path, *, measured_in: MeasuredIn = "world", probe: Probe | None = None, format: str = "csv"
    ) -> Measurements:
        """Measured poses out of a file, as ``readers.read_measurements`` does; other arguments as ``measurements``."""
        from truepath.readers import read_measurements

        return replace(
            read_measurements(path, self.robot, format),
            X_MB_nominal=stated_base(self.robot, measured_in),
            X_FE_nominal=stated_probe(self.place, probe),
        )

    def calibrate(
        self,
        measurements: Measurements,
        *,
        effects: Sequence[str] | str = "auto",
        residual: Literal["none", "network"] = "none",
        seed: int = 0,
        device: str = "cpu",
        progress: Progress = lambda _: None,
    ) -> Calibration:
        """Learns the robot that really stands there, measures on held-out poses what that is worth, and uses it.

        Args:
            measurements: from ``measurements`` or ``read_measurements``.
            effects: names to fit besides the kinematics; or, as on the command line, one string: ``auto``, those that
                the data speaks for, ``none``, or names with commas between them.
            residual: ``network`` also learns networks for what has no name, and keeps them if they help.
            seed, device: of the networks.
            progress: told in plain words what is being done.

        Raises:
            CalibrationError: the data cannot carry a calibration.
            InputError: an unknown effect, another number of joints, a device that is not there.
        """
        from truepath.learn import learn

        options = _networks(residual, seed, device)
        learnt = learn(
            self.robot,
            self._own(measurements),
            effects=_effects(effects),
            network=options,
            source=self.source,
            progress=progress,
        )
        return self.use(learnt.calibration)

    def diagnose(
        self,
        measurements: Measurements,
        *,
        residual: Literal["none", "network"] = "none",
        seed: int = 0,
        device: str = "cpu",
        plan: bool = True,
        progress: Progress = lambda _: None,
    ) -> Diagnosis:
        """Says what is wrong with the robot and why. The calibration in it is used only after ``use``.

        Args:
            measurements: from ``measurements`` or ``read_measurements``.
            residual, seed, device, progress: as ``calibrate``.
            plan: also plan what to measure next where causes cannot be told apart.

        Raises:
            CalibrationError, InputError: as ``calibrate``.
        """
        from truepath.diagnose import diagnose

        options = _networks(residual, seed, device)
        return diagnose(
            self.robot, self._own(measurements), source=self.source, plan=plan, network=options, progress=progress
        )

    def use(self, calibration: Calibration) -> Calibration:
        """Takes a calibration of this robot, also one that was learnt where it stood elsewhere.

        Joint limits, the direction of gravity and the place of the base become those of the host. The masses stay
        those that the calibration was learnt with; by what a stated base stood off from its place there, it is taken
        to stand off here. For another payload than was measured with: ``use(calibration.carrying(kg))``.

        Joints may have other names here (``left_elbow_joint``): the geometry decides, and the names become the host's.

        Raises:
            InputError: it belongs to another robot; with the numbers that differ.
        """
        require_same_robot(self.robot, calibration.model.robot)
        host = RobotPart.of(self.robot, self.source).model_dump()
        own = calibration.robot.model_dump()
        names = NAMES if own["joint_names"] != host["joint_names"] else ()
        if own["source"] == HOSTS_PLANT != self.source:
            names = (*names, "source")
        if names or any(own[name] != host[name] for name in FROM_THE_HOST):
            content = calibration.model_dump(by_alias=True)
            content["robot"].update({name: host[name] for name in (*names, *FROM_THE_HOST)})
            # The seal of names and geometry; the geometry is that of the calibration, to the last digit.
            named = replace(calibration.model.robot, joint_names=tuple(content["robot"]["joint_names"]))
            content["robot"]["model_sha256"] = named.model_sha256
            calibration = Calibration.model_validate(content)
        self._calibration = calibration
        return calibration

    def save(self, path: str | Path) -> None:
        """Writes the calibration in use to a file, as a whole or not at all.

        Raises:
            InputError: there is none; a place that cannot be written to.
        """
        self._in_use().save(path)

    def load(self, path: str | Path) -> Calibration:
        """Reads a calibration file and uses it.

        Raises:
            InputError: missing, damaged, or of another robot; then the one in use stays.
        """
        return self.use(load_calibration(path, self.robot))

    def _in_use(self) -> Calibration:
        if self._calibration is None:
            raise InputError("the plugin has no calibration", expected="calibrate, load or use one first")
        return self._calibration

    def _own(self, measurements: Measurements) -> Measurements:
        """Refuses a data set of a robot with other joints."""
        if measurements.q_rad.shape[1:] != (self.robot.num_joints,):
            raise InputError(
                "the data is of another robot",
                expected=f"{self.robot.num_joints} joints",
                found=str(measurements.q_rad.shape[1:]),
            )
        return measurements


def _effects(effects: Sequence[str] | str) -> Sequence[str] | Literal["auto"]:
    from truepath.effects import effect_named
    from truepath.pipeline import named_effects

    if isinstance(effects, str):
        return named_effects(effects)
    try:
        names = tuple(effects)
    except TypeError:
        raise InputError(
            "these are no effects", expected="auto, none, or names of effects", found=repr(effects)[:80]
        ) from None
    for name in names:
        effect_named(name)
    return names


def _networks(residual: str, seed: int, device: str) -> Options | None:
    if residual == "none":
        return None
    if residual != "network":
        raise InputError(f"unknown residual {residual!r}", expected="none or network")
    from truepath.residual.options import Options, require_device

    require_device(Options(device=device).device)
    return Options(seed=seed, device=device)
