"""Diagnoses made up for the report: data of a robot whose causes are written here, and no fit at all."""

from dataclasses import replace

import numpy as np
from by_hand import calibration_by_hand
from hand_made_networks import residual_about
from truepath import lie
from truepath.diagnosis import (
    Ambiguity,
    Diagnosis,
    Finding,
    FoundParameter,
    Gain,
    NotTestable,
    Stage,
    Unexplained,
)
from truepath.iso9283 import accuracy
from truepath.measurements import Measurements
from truepath.model import nominal_flange_poses, nominal_model
from truepath.plants import load_robot
from truepath.poe import flange_poses_and_jacobian
from truepath.residual.decision import Decision
from truepath.residual.proof import Proof

NOISE_M = 2.5e-5
UNKIND = "</script><script>document.title='broken'</script> & <b>\"bold\"</b> $\\frac{ <!-- ü"


def wave(theta):
    return 1.3e-4 * np.sin(2 * theta + 0.4) + 4e-5 * np.sin(23 * theta)


def true_causes(robot, q):
    """``(N, n)`` rad: waves on joints 2 and 4, softness of joint 3."""
    error = np.zeros_like(q)
    error[:, 1] = wave(q[:, 1])
    error[:, 3] = 0.6 * wave(q[:, 3] + 1.0)
    error[:, 2] = 3e-6 * robot.gravity_torque(q)[:, 2]
    return error


def rich(poses=400, *, six_d=False, name="cell_7_tracker.csv", context=True, left=0.15, seed=0):
    """Two findings with joints and one without, an ambiguity, outliers, something that could not be tested."""
    robot = load_robot("ur5")
    measurements, X_MB = _measured(robot, poses, six_d, context, name, seed)
    turn = true_causes(robot, measurements.q_rad)
    turn_only = [1.0, left]
    rng = np.random.default_rng(seed + 1)
    size = 6 if six_d else 3
    noise = rng.normal(scale=NOISE_M, size=(poses, size))
    clock = np.linspace(0, 1, poses)
    drift = np.zeros((poses, size))
    drift[:, 2] = 8e-5 * (1 - np.exp(-clock / 0.3))
    outlier = np.zeros(poses, bool)
    outlier[[7, poses // 2, poses - 3]] = True
    J = _jacobian(robot, measurements.q_rad, X_MB)
    bent = np.einsum("kij,kj->ki", J, turn)[:, :size]
    residuals = {
        "nominal": bent
        + noise
        + drift
        + rng.normal(scale=2e-3 / np.sqrt(3), size=(1, size))
        + 4e-4 * np.sin(3 * noise),
        "kinematic": turn_only[0] * (bent + drift) + noise,
        "final": turn_only[1] * (bent + drift) + noise,
    }
    for values in residuals.values():
        values[outlier, :3] += 0.004
    joint_view = {stage: _joint_view(J, residuals[stage]) for stage in ("kinematic", "final")}
    unseen = rng.random(poses) < 0.2
    calibration = calibration_by_hand(robot, measurements, X_MB, outlier)
    diagnosis = Diagnosis(
        verdict=(
            "The robot is off by 0.079 mm after its geometry is calibrated; transmission error of joints 2 and 4 and "
            "compliance of joint 3 explain nearly all of that and leave 0.041 mm, close to the noise floor."
        ),
        measurements=measurements,
        calibration=calibration,
        fit=None,
        outlier=outlier,
        unseen=unseen,
        stages=(),
        findings=_findings(),
        ambiguous=(
            Ambiguity(
                ("measurement_scale", "kinematic"),
                "all lengths are 0.03 % long: check the tracker's scale or the temperature",
            ),
            Ambiguity(
                ("frame_drift", "joint_compliance"),
                "poses were measured in sweep order, so drift in time looks like an effect of joint 2",
                np.zeros((24, robot.num_joints)),
                "measure_next.csv",
            ),
        ),
        unexplained=Unexplained(
            True, 2.4e-5, 0.0412, 0.0391, "neighbours", ("goes with the angle of joint 5, three cycles per turn",)
        ),
        not_testable=()
        if context
        else (
            NotTestable("thermal_expansion", ("temperature_c",), "no temperature was recorded"),
            NotTestable("warmup_drift", ("t_s",), "no time was recorded"),
        ),
        seen_models={},
        residuals=residuals,
        joint_view=joint_view,
    )
    return replace(diagnosis, stages=_stages(diagnosis))


def empty(poses=150):
    """Nothing found, nothing in doubt, nothing left out."""
    diagnosis = rich(poses, left=0.0, context=False)
    found_nothing = diagnosis.residuals["final"]
    nothing = replace(
        diagnosis,
        verdict="The kinematic model explains the data down to the noise floor; no named cause is needed.",
        outlier=np.zeros(poses, bool),
        findings=(),
        ambiguous=(),
        not_testable=(),
        unexplained=Unexplained(False, 0.43, 0.0399, 0.0391, "repeats"),
        residuals={"nominal": diagnosis.residuals["nominal"], "kinematic": found_nothing, "final": found_nothing},
        joint_view={stage: diagnosis.joint_view["final"] for stage in ("kinematic", "final")},
    )
    return replace(nothing, stages=_stages(nothing)[:2])


def networked(diagnosis=None, *, size_m=3e-5):
    """Networks that entered: what they say is not what is missed, but the report cannot know that."""
    diagnosis = rich(100) if diagnosis is None else diagnosis
    middle = diagnosis.measurements.q_rad.mean(axis=0)
    outputs = 6 if diagnosis.measurements.has_orientation else 3
    residual = residual_about(middle, half_width_rad=2.8, size_m=size_m, outputs=outputs)
    model = replace(nominal_model(load_robot("ur5")), residual=residual)
    gain = Gain(0.0452, 0.0404, (0.0021, 0.0075))
    decision = Decision(Proof(1.3e-8, 0.0457, 0.0409), gain, model, "in the model: it helps (p = 1.3e-08)")
    last = diagnosis.stages[-1]
    stages = (*diagnosis.stages, Stage(f"{last.model}+network", last.accuracy))
    return replace(diagnosis, network=decision, stages=stages)


def left_out(*, asked_unseen_poses=False):
    """Networks that proved nothing, in cross-validation already or only on the unseen poses."""
    gain = Gain(0.0452, 0.0455, (-0.0011, 0.0005)) if asked_unseen_poses else None
    decision = Decision(Proof(0.31, 0.0457, 0.0455), gain, None, "left out: p = 0.31 does not prove a gain")
    return replace(rich(60), network=decision)


def _findings():
    waves = [
        FoundParameter(f"{kind} {k}", joint, 1.3e-4 / k * (1 if kind == "cos" else -0.7), 2.1e-6, "rad")
        for joint in (2, 4)
        for k in (1, 2, 3, 5, 8, 12, 23)
        for kind in ("cos", "sin")
    ]
    return (
        Finding(
            "transmission_error",
            (2, 4),
            "gear, encoder or their mounting is out of round",
            "keep the correction table of this joint; have the gear looked at if the error is out of the usual",
            0.0,
            212.4,
            Gain(0.0785, 0.0452, (0.0297, 0.0371)),
            tuple(waves),
            ("joint 2: 98 µrad rms, strongest at 2 and 23 cycles per turn", "joint 4: 59 µrad rms, strongest at 2"),
        ),
        Finding(
            "joint_compliance",
            (3,),
            "gears and bearings give way under the weight of the arm",
            "keep the payload that was calibrated",
            3.2e-9,
            31.0,
            Gain(0.0533, 0.0452, (0.0049, 0.0113)),
            (FoundParameter("compliance", 3, 3.04e-6, 1.1e-7, "rad/(N m)"),),
            ("joint 3: 3.0 µrad/(N m), up to 61 µrad",),
        ),
        Finding(
            "frame_drift",
            (),
            "the tracker, or the pedestal of the robot, moved while poses were measured",
            "fasten both, let the tracker warm up; find the frames anew",
            0.0041,
            4.1,
            Gain(0.0461, 0.0452, (-0.0003, 0.0021)),
            (FoundParameter("z order 1", None, 8.1e-5, 6.0e-6, "m"),),
            ("80 µm along z within 3.3 hours",),
        ),
    )


def _stages(diagnosis):
    m, kept = diagnosis.measurements, diagnosis.unseen & ~diagnosis.outlier
    shares = {"nominal": None, "kinematic": 1.0, "kinematic+transmission_error": 0.55}
    shares |= {"kinematic+transmission_error+joint_compliance": 0.25}
    shares |= {"kinematic+transmission_error+joint_compliance+frame_drift": 0.0}
    stages = []
    for model, share in shares.items():
        r = diagnosis.residuals
        error = r["nominal"] if share is None else share * r["kinematic"] + (1 - share) * r["final"]
        X = np.tile(np.eye(4), (len(m), 1, 1))
        X[:, :3, 3] = m.p_ME + error[:, :3]
        if m.has_orientation:
            X[:, :3, :3] = lie.from_rotation_vector(error[:, 3:]) @ m.R_ME
        R = None if m.R_ME is None else m.R_ME[kept]
        stages.append(Stage(model, accuracy(X[kept], m.p_ME[kept], R, np.arange(kept.sum()))))
    return tuple(stages)


def _measured(robot, poses, six_d, context, name, seed):
    rng = np.random.default_rng(seed)
    q = rng.uniform([-2.8, -2.6, -2.4, -3.0, -2.5, -3.1], [2.8, -0.3, 2.4, 3.0, 2.5, 3.1], (poses, 6))
    X_MB = lie.make_pose(lie.from_rotation_vector(np.array([0.0, 0.0, 0.7])), np.array([2.6, 0.4, 0.5]))
    X_FE = lie.make_pose(translation=np.array([0.04, 0.0, 0.09]))
    X_ME = X_MB @ nominal_flange_poses(robot, q) @ X_FE
    more = {}
    if context:
        clock = np.linspace(0, 1, poses)
        more = {"time_s": 12000.0 * clock + 50.0, "temperature_c": 21.0 + 3 * (1 - np.exp(-2 * clock))}
    R_ME = X_ME[:, :3, :3] if six_d else None
    return Measurements(q, X_ME[:, :3, 3], R_ME, source=name, **more), X_MB


def _jacobian(robot, q, X_MB):
    """``(N, 6, n)`` shift and turn of a probe near the flange, in M, by each joint."""
    _, J = flange_poses_and_jacobian(robot, np.zeros(4 * robot.num_joints + 12), q)
    R = X_MB[:3, :3]
    return np.concatenate([R @ J[:, 3:], R @ J[:, :3]], axis=1)


def _joint_view(J, residual):
    linear = J[:, :3]
    weight = np.einsum("kij,kij->kj", linear, linear)
    turn = np.einsum("kij,ki->kj", linear, residual[:, :3])
    return np.where(weight > 0.05**2, turn / np.maximum(weight, 1e-12), np.nan)


def unkind():
    """Every text that can come from a file or a person tries to break out."""
    diagnosis = rich(60, name=UNKIND)
    calibration = diagnosis.calibration
    robot = calibration.robot.model_copy(update={"name": UNKIND, "joint_names": [UNKIND] * 6})
    parameters = [
        p.model_copy(update={"reason": UNKIND if p.status == "held" else None}) for p in calibration.parameters
    ]
    calibration = calibration.model_copy(
        update={"robot": robot, "parameters": parameters, "software": {UNKIND: UNKIND}}
    )
    finding = diagnosis.findings[0]
    parameter = replace(finding.parameters[0], name=UNKIND, unit=UNKIND)
    texts = {"effect": UNKIND, "cause": UNKIND, "remedy": UNKIND, "summary": (UNKIND,), "parameters": (parameter,)}
    return replace(
        diagnosis,
        verdict=UNKIND,
        calibration=calibration,
        findings=(replace(finding, **texts),),
        ambiguous=(Ambiguity((UNKIND, UNKIND), UNKIND, None, "javascript:alert(1)" + UNKIND),),
        not_testable=(NotTestable(UNKIND, (UNKIND,), UNKIND),),
        unexplained=replace(diagnosis.unexplained, hints=(UNKIND,), floor_from=UNKIND),
    )


def too_few():
    """So little data that nothing could be kept away."""
    diagnosis = rich(20, context=False)
    nobody = np.zeros(20, bool)
    unknown = Unexplained(False, 1.0, float("nan"), float("nan"), "neighbours")
    changes = {"stages": (), "findings": (), "ambiguous": (), "not_testable": (), "residuals": {}, "joint_view": {}}
    return replace(diagnosis, outlier=nobody, unseen=nobody, unexplained=unknown, **changes)
