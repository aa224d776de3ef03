"""The robot that a truth file tells of, built a second time: frames and gravity by Drake, hidden causes by hand."""

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.framework import DiagramBuilder
from truepath import plants


def reflector_poses(truth, q_rad, time_s=None, approach=None):
    """``(N, 4, 4)`` poses of the reflector in the world for commands ``(N, 6)``.

    Args:
        truth: content of the truth file; ``{}`` is a robot without errors.
        time_s, approach: ``(N,)`` and ``(N, 6)``, needed where a cause goes with them.
    """
    plant, _ = plants.add_cell(DiagramBuilder(), truth.get("cell", "ur5_cell"))
    context = plant.CreateDefaultContext()
    for name, error in truth.get("hidden_frame_errors", {}).items():
        frame = plant.GetFrameByName(name)
        X = RigidTransform(RollPitchYaw(error["rpy_rad"]), error["translation_m"])
        frame.SetPoseInParentFrame(context, frame.GetPoseInParentFrame(context) @ X)
    poses = []
    for k, commanded in enumerate(q_rad):
        plant.SetPositions(context, commanded)
        torque = plant.CalcGravityGeneralizedForces(context)
        angles = np.array(commanded)
        seen_from, on_flange = RigidTransform(), RigidTransform()
        for cause in truth.get("hidden_causes", []):
            for size in cause["sizes"]:
                i = size.get("joint", 0) - 1
                if cause["effect"] == "transmission_error":
                    wave = np.sin(size["cycles_per_turn"] * commanded[i] + size["phase_rad"])
                    angles[i] += size["amplitude_rad"] * wave
                elif cause["effect"] == "joint_compliance":
                    angles[i] += size["compliance_rad_per_nm"] * torque[i]
                elif cause["effect"] == "backlash":
                    angles[i] -= size["width_rad"] / 2 * approach[k, i]
                elif time_s[k] <= size["moment_s"]:
                    continue
                elif cause["effect"] == "frame_drift":
                    turn = np.array(size["turn_rad"])  # so small that the order of its parts is below a nanometre
                    seen_from = RigidTransform(RollPitchYaw(turn), size["shift_m"])
                elif cause["effect"] == "tool_shift":
                    on_flange = RigidTransform(size["shift_m"])
                else:
                    raise ValueError(f"nobody has said by hand what {cause['effect']} does")
        plant.SetPositions(context, angles)
        X_WE = plant.GetFrameByName("reflector").CalcPoseInWorld(context)
        poses.append((seen_from @ X_WE @ on_flange).GetAsMatrix4())
    return np.array(poses)
