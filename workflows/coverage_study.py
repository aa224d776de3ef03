"""Are the standard deviations of a calibration true? Many virtual robots are calibrated and compared with their truth.

For every identifiable parameter of every robot the deviation from Drake's truth is divided by the standard
deviation that the calibration stated. If those are right, 95 % of the results lie within +-1.96, whatever
the parameter. Exits with 1 if they do not.

    python workflows/coverage_study.py --seeds 50
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation
from truepath.calibrate import Fit, calibrate
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure
from truepath.virtual.truth import true_deviations

INTERVAL = 1.96  # half width of a 95 % interval in standard deviations
COVERAGE = (0.90, 0.99)
LARGEST = 4.0  # sigmas; by chance alone one in a dozen studies of 50 robots would have a larger one
NOISE_TOLERANCE = 0.02  # of the mean noise estimate


@dataclass(frozen=True)
class Study:
    """Results of S calibrated robots.

    Attributes:
        sigmas: parameter to its deviations from the truth, ``(S,)``, in standard deviations.
        noise_ratio: ``(S,)`` estimated by true noise of a position.
        orientation_noise_ratio: the same of an orientation, None where it was not measured.
    """

    sigmas: dict[str, np.ndarray]
    noise_ratio: np.ndarray
    orientation_noise_ratio: np.ndarray | None

    @property
    def everything(self) -> np.ndarray:
        """Deviations of all parameters of all robots, in standard deviations."""
        return np.concatenate(list(self.sigmas.values()))

    @property
    def coverage(self) -> float:
        """Share of the 95 % intervals that hold the truth."""
        return _coverage(self.everything)

    @property
    def largest(self) -> float:
        """Largest deviation in standard deviations."""
        return float(np.abs(self.everything).max())

    def complaints(self) -> list[str]:
        """What is not as it should be, in words."""
        found = []
        if not COVERAGE[0] <= self.coverage <= COVERAGE[1]:
            found.append(f"95 % intervals hold the truth in {self.coverage:.1%} of the cases")
        if not self.largest <= LARGEST:
            found.append(f"a parameter lies {self.largest:.1f} standard deviations from the truth")
        for kind, ratio in (("position", self.noise_ratio), ("orientation", self.orientation_noise_ratio)):
            if ratio is not None and not abs(ratio.mean() - 1.0) <= NOISE_TOLERANCE:
                found.append(f"the {kind} noise is estimated at {ratio.mean():.1%} of its size")
        return found

    def table(self) -> str:
        """A line for each kind of parameter and one for all."""
        kinds: dict[str, list[np.ndarray]] = {}
        for name, values in self.sigmas.items():
            group, _, field = name.partition(".")
            kind = f"{'axis' if group.startswith('axis') else group} {'position' if 'pos' in field else 'rotation'}"
            kinds.setdefault(kind, []).append(values)
        lines = [f"{'parameters':<16}{'number':>8}{'coverage':>10}{'largest':>9}{'rms':>7}"]
        for kind, parts in [*kinds.items(), ("all", list(self.sigmas.values()))]:
            values = np.concatenate(parts)
            rms = float(np.sqrt(np.mean(values**2)))
            lines.append(f"{kind:<16}{len(parts):>8}{_coverage(values):>10.1%}{np.abs(values).max():>9.2f}{rms:>7.2f}")
        for label, ratio in (("position", self.noise_ratio), ("orientation", self.orientation_noise_ratio)):
            if ratio is not None:
                lines.append(
                    f"{label} noise, estimated / true: {ratio.mean():.3f} ({ratio.min():.3f}-{ratio.max():.3f})"
                )
        return "\n".join(lines)


def deviations_in_sigmas(real: RealRobot, fit: Fit) -> dict[str, float]:
    """Estimate minus truth in stated standard deviations, for every parameter that is not held.

    Args:
        real: the robot that was measured, in the frame of its world.
        fit: its calibration.
    """
    axes, X_WB, X_FE = true_deviations(real)
    error = np.concatenate(
        [fit.model.p[: axes.size] - axes.ravel(), -_step(fit.model.X_MB, X_WB), -_step(fit.model.X_FE, X_FE)]
    )
    free = [index for index in range(len(error)) if index not in fit.held]
    return {str(fit.names[index]): float(error[index] / fit.sigma[index]) for index in free}


def run_study(
    seeds: int,
    *,
    poses: int = 300,
    noise_mm: float = 0.02,
    orientation_noise_mrad: float | None = None,
    robot: str = "ur5",
    progress: Callable[[int], None] = lambda _: None,
) -> Study:
    """Calibrates that many robots, each with its own hidden errors, poses and noise."""
    sigmas: dict[str, list[float]] = {}
    noise, orientation_noise = [], []
    for seed in range(seeds):
        progress(seed)
        real = RealRobot(robot, seed)
        campaign = Campaign(poses=poses, noise_mm=noise_mm, orientation_noise_mrad=orientation_noise_mrad, seed=seed)
        fit = calibrate(real.robot, measure(real, free_poses(real, poses, np.random.default_rng(seed)), campaign))
        for name, value in deviations_in_sigmas(real, fit).items():
            sigmas.setdefault(name, []).append(value)
        noise.append(1e3 * fit.sigma_position_m / noise_mm)
        if fit.sigma_orientation_rad is not None and orientation_noise_mrad is not None:
            orientation_noise.append(1e3 * fit.sigma_orientation_rad / orientation_noise_mrad)
    return Study(
        {name: np.array(values) for name, values in sigmas.items()},
        np.array(noise),
        np.array(orientation_noise) if orientation_noise else None,
    )


def _coverage(sigmas: np.ndarray) -> float:
    return float(np.mean(np.abs(sigmas) <= INTERVAL))


def _step(X_estimated: np.ndarray, X_true: np.ndarray) -> np.ndarray:
    """``(6,)`` the small step, position and rotation, from the estimated to the true frame."""
    X = np.linalg.inv(X_estimated) @ X_true
    return np.concatenate([X[:3, 3], Rotation.from_matrix(X[:3, :3]).as_rotvec()])


def main(arguments: list[str] | None = None) -> int:
    """Prints the table; 0 if all is as it should be, else 1."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=50, help="number of virtual robots (default 50)")
    parser.add_argument("--poses", type=int, default=300, help="measured poses of each (default 300)")
    parser.add_argument("--noise-mm", type=float, default=0.02, help="noise of each coordinate (default 0.02)")
    parser.add_argument("--orientation-noise-mrad", type=float, help="measure orientation too, with this noise")
    parser.add_argument("--robot", default="ur5", help="ur5 (default) or ur10")
    given = parser.parse_args(arguments)
    if given.seeds < 1 or given.noise_mm <= 0 or (given.orientation_noise_mrad or 1) <= 0:
        parser.error("seeds and noise must be larger than 0")

    def progress(seed: int) -> None:
        print(f"\r{seed + 1} of {given.seeds}", end="", file=sys.stderr, flush=True)

    study = run_study(
        given.seeds,
        poses=given.poses,
        noise_mm=given.noise_mm,
        orientation_noise_mrad=given.orientation_noise_mrad,
        robot=given.robot,
        progress=progress,
    )
    print(file=sys.stderr)
    print(study.table())
    complaints = study.complaints()
    for complaint in complaints:
        print(f"not as it should be: {complaint}")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
