"""Do planned poses pay? Virtual robots are calibrated from planned and from random feasible poses, as many of each.

The plan is made once, from the drawing. Every robot has its own hidden frame errors, and its own random poses, which
pass the same test as the planned ones: joint limits, collision, reach, sight of the tracker. Noise and fit are the
same for both. The error is that of the calibrated model against Drake on fresh poses from all over the workspace,
where the robot works although the tracker need not see it there; no fit has seen them. Exits with 1 if the mean error
after planned poses is not lower by the stated share in the setting that is named for it.

    python workflows/plan_study.py --seeds 50
    python workflows/plan_study.py --seeds 50 --settings everywhere laser "laser 6D" fixed --json study.json

What a choice of poses can gain is limited: with every pose in sight and rigid errors only, uniform random joints are
nearly the best design already. The gain that theory expects is printed beside the one that was found. The named
setting is what truepath is for: a laser tracker, whose ball is not seen from everywhere, and a cause to be found.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from truepath.calibrate import calibrate
from truepath.files import write_atomically
from truepath.planning.campaign import plan_campaign
from truepath.planning.design import Wish
from truepath.planning.feasible import Feasible
from truepath.planning.setup import feasible_poses, robot_in_cell, stated_noise
from truepath.planning.sight import Sight, stated_sight
from truepath.virtual.hidden_causes import draw_causes, true_poses
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, measure
from truepath.virtual.visits import Visits

CELL = "ur5"
LOWER_BY = 0.30
LASER = ("2.5,1.0,1.2", "0.5,10", 30.0, "z")  # a laser tracker beside the table, a ball of 30 degrees either way
FIXED = (*LASER, "0.6,0,0.9", 10.0)  # one that does not turn its head and looks at the work on the table


@dataclass(frozen=True)
class Setting:
    """Under what circumstances is measured.

    Attributes:
        sight: arguments of ``stated_sight``; None: seen everywhere.
        effects: hidden in the robot, and given to plan and fit.
        orientation_noise_mrad: of a 6D probe.
        repeats: visits of a pose once more, within the budget.
    """

    sight: tuple[Any, ...] | None
    effects: tuple[str, ...] = ()
    orientation_noise_mrad: float | None = None
    repeats: int = 0

    def stated(self) -> Sight | None:
        return None if self.sight is None else stated_sight(*self.sight)


SETTINGS = {
    "everywhere": Setting(None),
    "everywhere+compliance": Setting(None, ("joint_compliance",)),
    "everywhere 6D": Setting(None, orientation_noise_mrad=0.1),
    "laser": Setting(LASER),
    "laser+compliance": Setting(LASER, ("joint_compliance",)),
    "fixed": Setting(FIXED),
    "fixed+compliance": Setting(FIXED, ("joint_compliance",)),
    "laser+compliance, 4 repeats": Setting(LASER, ("joint_compliance",), repeats=4),
    "laser 6D": Setting(LASER, orientation_noise_mrad=0.1),
}
NAMED = "laser+compliance"


@dataclass(frozen=True)
class Result:
    """Errors in mm, means over the fresh poses, one for each of S robots.

    Attributes:
        planned, random: ``(S,)``.
        expected: how much lower theory has the mean standard deviation of the tool.
    """

    planned: list[float]
    random: list[float]
    expected: float

    @property
    def lower_by(self) -> float:
        """Share by which the mean error is lower."""
        return 1.0 - float(np.mean(self.planned) / np.mean(self.random))

    def interval(self) -> tuple[float, float]:
        """95 % of that share, robots drawn with replacement (Efron 1979)."""
        pairs, rng = np.array([self.planned, self.random]), np.random.default_rng(0)
        drawn = pairs[:, rng.integers(0, pairs.shape[1], (2000, pairs.shape[1]))].mean(axis=2)
        low, high = np.percentile(1.0 - drawn[0] / drawn[1], [2.5, 97.5])
        return float(low), float(high)


def study(
    setting: Setting,
    seeds: int,
    *,
    poses: int = 60,
    noise_mm: float = 0.02,
    candidates: int = 1500,
    fresh_poses: int = 400,
    everywhere: Feasible | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Result:
    """Plans once, then measures, calibrates and judges that many robots both ways."""
    robot, cell = robot_in_cell(CELL, None)
    everywhere = everywhere or feasible_poses(robot, cell, "model", None)
    feasible = replace(everywhere, sight=setting.stated())
    sigma = stated_noise(noise_mm, setting.orientation_noise_mrad)
    wish = Wish(poses, setting.repeats)
    plan = plan_campaign(feasible, wish, sigma, setting.effects, candidates=candidates, say=say)
    planned = plan.poses.q_rad[plan.poses.measure]
    fresh = everywhere.draw(fresh_poses, np.random.default_rng(20))
    by_chance = feasible.draw(poses * min(seeds, 40), np.random.default_rng(21), say)
    result = Result([], [], 1.0 - float(plan.design.tool_sigma_m.mean() / np.median(plan.design.random_sigma_m)))
    for seed in range(seeds):
        say(f"robot {seed + 1} of {seeds}")
        real = RealRobot(CELL, seed)
        causes = draw_causes(real, setting.effects)
        truth = true_poses(real, Visits.of(real, fresh), list(causes.values()))[:, :3, 3]
        random = by_chance[np.random.default_rng([seed, 1]).permutation(len(by_chance))[:poses]]
        for q_rad, errors, noise_seed in ((planned, result.planned, seed), (random, result.random, 1000 + seed)):
            campaign = Campaign(poses, noise_mm, setting.orientation_noise_mrad, seed=noise_seed)
            model = calibrate(robot, measure(real, q_rad, campaign, causes), setting.effects).model
            errors.append(1e3 * float(np.linalg.norm(model.predict(fresh)[:, :3, 3] - truth, axis=1).mean()))
    return result


def table(results: dict[str, Result]) -> str:
    """A line for each setting."""
    head = f"{'setting':<30}{'planned, mm':>13}{'random, mm':>13}{'lower by':>10}{'95 %':>16}{'in theory':>11}"
    lines = [head]
    for name, result in results.items():
        low, high = result.interval()
        errors = f"{np.mean(result.planned):>13.4f}{np.mean(result.random):>13.4f}"
        lines.append(f"{name:<30}{errors}{result.lower_by:>10.1%}{low:>8.1%} -{high:>6.1%}{result.expected:>11.1%}")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the table; 0 if the stated share is reached, else 1."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=50, help="number of virtual robots (default 50)")
    parser.add_argument("--poses", type=int, default=60, help="measurements of each (default 60)")
    parser.add_argument("--noise-mm", type=float, default=0.02, help="noise of each coordinate (default 0.02)")
    parser.add_argument("--candidates", type=int, default=1500, help="to choose from (default 1500)")
    parser.add_argument(
        "--settings", nargs="+", choices=[*SETTINGS], default=["everywhere", "everywhere+compliance", "laser", NAMED]
    )
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    given = parser.parse_args(arguments)
    if given.seeds < 1 or given.noise_mm <= 0:
        parser.error("seeds and noise must be larger than 0")

    robot, cell = robot_in_cell(CELL, None)
    everywhere = feasible_poses(robot, cell, "model", None)
    results = {}
    for name in given.settings:

        def say(text: str, name: str = name) -> None:
            print(f"\r\033[K{name}: {text}", end="", file=sys.stderr, flush=True)

        results[name] = study(
            SETTINGS[name],
            given.seeds,
            poses=given.poses,
            noise_mm=given.noise_mm,
            candidates=given.candidates,
            everywhere=everywhere,
            say=say,
        )
    print(file=sys.stderr)
    print(table(results))
    content = {
        "schema": "truepath.plan_study/1",
        "seeds": given.seeds,
        "poses": given.poses,
        "noise_mm": given.noise_mm,
        "wanted_lower_by": LOWER_BY,
        "settings": {
            name: {**asdict(result), "lower_by": result.lower_by, "interval_95": result.interval()}
            for name, result in results.items()
        },
    }
    print(json.dumps({name: round(result.lower_by, 4) for name, result in results.items()}))
    if given.json is not None:
        write_atomically(given.json, json.dumps(content, indent=1) + "\n")
    missed = NAMED in results and results[NAMED].lower_by < LOWER_BY
    if missed:
        print(f"missed: planned poses are to be better by {LOWER_BY:.0%} in the setting {NAMED!r}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
