"""Drawing a case: a robot, a campaign, and a cause that is neither too small to be seen nor too large to be missed."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np
from truepath.virtual.real_robot import Imperfection

from hidden_effects import confounded
from hidden_effects.campaign import Campaign, add_noise, add_outliers, extended, random_campaign, to_csv, tracker_frame
from hidden_effects.cause import Cause, fit_into, visible_rms
from hidden_effects.library import LIBRARY, backlash, measurement_scale
from hidden_effects.outside import OUTSIDE, bases_of_library, is_outside
from hidden_effects.robot import FRESH, SPECS, HiddenRobot, pool
from hidden_effects.scene import Visible

EFFECTS = (*LIBRARY, "outlier")  # each can be hidden alone
CONFOUNDED = ("scale", "small_workspace", "sweep")
SEEN = {"joint_compliance": (1.0, 20.0)}  # a soft joint 2 is never seen less clearly
SEEN_USUALLY = (
    1.0,
    6.0,
)  # sigmas of a coordinate that geometry cannot take away: hundreds of poses show that, few do not
SEEN_OUTSIDE = (2.0, 6.0)
FACTORY = Imperfection(joint_position_mm=0.05, joint_rotation_mrad=0.3)  # else nobody could see that lengths are off
OPTIONAL = ("time", "temperature", "approach")


@dataclass(frozen=True)
class Truth:
    """What was hidden.

    Attributes:
        kind, seed, spec, poses, noise_m, noise_rad: of the case.
        effects: name to joints (from 1, empty where none is concerned), of the vocabulary or of an outside cause.
        parameters: ``(effect, parameter, joint or None)`` to its value, SI units.
        visible_sigmas: effect to root mean square of what kinematics cannot imitate.
        outlier_rows: counted from 1.
        pose_only: the cause depends on nothing but the commanded joints.
    """

    kind: str
    seed: int
    spec: str
    poses: int
    noise_m: float
    noise_rad: float | None
    effects: dict[str, tuple[int, ...]]
    parameters: dict[tuple[str, str, int | None], float]
    visible_sigmas: dict[str, float]
    outlier_rows: tuple[int, ...]
    pose_only: bool


class HiddenCase:
    """A measured robot. Only ``spec`` and ``csv`` are for the diagnosis."""

    def __init__(self, kind, seed, robot, campaign, causes, columns, outlier_share, rng):
        self.spec = str(robot.real.spec)
        self._robot, self._campaign, self._causes, self._columns = robot, campaign, causes, columns
        self._identity, self._seed = (kind, seed), int(rng.integers(2**31))
        scene = robot.survey(campaign, campaign.time_s[-1])
        poses = add_noise(rng, robot.true_poses(scene, self._motion(scene)), campaign.noise_m, campaign.noise_rad)
        self._poses, self._outlier_rows = add_outliers(rng, poses, outlier_share) if outlier_share else (poses, ())
        self.csv = to_csv(campaign, self._poses, columns)

    def measure_more(self, q):
        """The CSV with further poses ``(k, n)`` at its end, measured on the same robot later on."""
        rng = np.random.default_rng(self._seed)
        longer = extended(rng, self._campaign, np.atleast_2d(q))
        scene = self._robot.survey(longer, self._campaign.time_s[-1])
        poses = add_noise(rng, self._robot.true_poses(scene, self._motion(scene)), longer.noise_m, longer.noise_rad)
        poses[: len(self._poses)] = self._poses
        return to_csv(longer, poses, self._columns)

    def fresh(self, count=FRESH):
        """Other poses ``(count, n)`` of the cell and their measured positions ``(count, 3)`` in m."""
        rng = np.random.default_rng(self._seed + 1)
        q = pool(self.spec)[-FRESH:][:count]
        longer = extended(rng, self._campaign, q)
        rows = {
            name: getattr(longer, name)[-len(q) :]
            for name in ("q", "time_s", "temperature_c", "payload_kg", "approach")
        }
        scene = self._robot.survey(replace(longer, **rows), self._campaign.time_s[-1])
        poses = add_noise(rng, self._robot.true_poses(scene, self._motion(scene)), longer.noise_m, None)
        return q, poses[:, :3, 3]

    def unseal(self):
        """The truth. Look at it when the verdict is in."""
        campaign, causes = self._campaign, self._causes
        scene = self._robot.survey(campaign, campaign.time_s[-1])
        visible = Visible(scene, campaign.noise_m, campaign.noise_rad)
        return Truth(
            *self._identity,
            spec=self.spec,
            poses=len(campaign.q),
            noise_m=float(campaign.noise_m),
            noise_rad=None if campaign.noise_rad is None else float(campaign.noise_rad),
            effects={cause.effect: cause.joints for cause in causes},
            parameters={
                (cause.effect, name, part.joint): float(value)
                for cause in causes
                for part in cause.parts
                for name, value in part.stated.items()
            },
            visible_sigmas={cause.effect: visible_rms(cause, scene, visible)[0] for cause in causes},
            outlier_rows=self._outlier_rows,
            pose_only=bool(causes) and all(cause.pose_only for cause in causes) and not campaign.payload_kg.any(),
        )

    def _motion(self, scene):
        return sum((cause.motion(scene) for cause in self._causes), scene.still())


def draw_case(kind, seed, *, poses=None, six_d=None, outliers=None):
    """A case of a kind: ``single:EFFECT``, ``pair``, ``none``, ``outside`` or ``confounded:DESIGN``.

    Args:
        kind: as above; the same kind and seed always give the same case.
        seed: 0 or more.
        poses, six_d, outliers: instead of a draw, where the kind leaves the choice.
    """
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    share = 0.02 if (rng.random() < 0.2 if outliers is None else outliers) else 0.0
    if kind == "single:outlier":
        share = rng.uniform(0.02, 0.05)
    for _ in range(100):  # some campaigns are too noisy for some effects
        robot, campaign, causes = _draw(kind, seed, rng, poses, six_d)
        if causes is not None:
            return HiddenCase(kind, seed, robot, campaign, causes, _columns(campaign, causes, rng), share, rng)
    raise RuntimeError(f"no case {kind} with seed {seed} could be drawn")


def _draw(kind, seed, rng, poses, six_d):
    spec = str(rng.choice(SPECS))
    imperfection = FACTORY if kind == "confounded:scale" else Imperfection()
    robot = HiddenRobot(spec, int(rng.integers(2**31)), imperfection)
    swept = list(confounded.SWEPT_JOINTS)[seed % len(confounded.SWEPT_JOINTS)]
    joint = int(rng.choice(confounded.SWEPT_JOINTS[swept]))
    campaign = _campaign(kind, spec, rng, robot, joint, poses, six_d)
    robot.X_MW = campaign.X_MW
    scene = robot.survey(campaign, campaign.time_s[-1])
    visible = Visible(scene, campaign.noise_m, campaign.noise_rad)
    return robot, campaign, _causes(kind, seed, rng, scene, visible, swept, joint)


def _campaign(kind, spec, rng, robot, joint, poses, six_d) -> Campaign:
    if kind == "confounded:small_workspace":
        return confounded.around_one_posture(rng, spec, robot.real.is_free)
    if kind == "confounded:sweep":
        return confounded.in_order(rng, spec, robot.real.is_free, joint)
    if kind == "outside":  # what has no name must be seen in the residual as such: that takes more poses
        campaign = random_campaign(rng, spec, 300, poses, six_d, repeated=0.5)
        return replace(campaign, X_MW=tracker_frame(rng))  # some of these causes are the tracker's own
    campaign = random_campaign(rng, spec, count=poses, six_d=six_d)
    if kind == "single:joint_compliance" and rng.random() < 0.25:
        return replace(campaign, payload_kg=rng.choice([0.0, 1.5, 3.0], len(campaign.q)))
    return campaign


def _causes(kind, seed, rng, scene, visible, swept, joint) -> tuple[Cause, ...] | None:
    """The hidden causes, none where nothing suited the campaign."""
    group, _, name = kind.partition(":")
    if group == "none" or kind == "single:outlier":
        return ()
    if kind == "confounded:scale":
        return (measurement_scale(rng, least=3e-4),)
    bases = bases_of_library(scene, visible) if group == "outside" else ()
    makers = {
        "single": lambda: _seen(rng, LIBRARY[name](rng), scene, visible),
        "pair": lambda: _seen_together(rng, scene, visible),
        "outside": lambda: _from_outside(rng, OUTSIDE[seed % len(OUTSIDE)](rng), scene, visible, bases),
        "confounded": lambda: _confounded(name, rng, scene, visible, swept, joint),
    }
    for _ in range(100):
        causes = makers[group]()
        if causes is not None:
            return causes
    return None


def _seen(rng, cause, scene, visible):
    cause = _fit(cause, scene, visible, rng)
    return None if cause is None else (cause,)


def _seen_together(rng, scene, visible):
    names = rng.choice(list(LIBRARY), 2, replace=False)
    # Beside another cause only play with known directions of arrival can be asked for.
    first, second = (backlash(rng, by_gravity=False) if n == "backlash" else LIBRARY[n](rng) for n in names)
    first = _fit(first, scene, visible, rng)
    second = first and _fit(second, scene, visible, rng, (first,))
    first = second and _fit(first, scene, visible, rng, (second,))
    return first and (first, second)


def _fit(cause, scene, visible, rng, beside=()):
    return fit_into(cause, scene, visible, rng, *SEEN.get(cause.effect, SEEN_USUALLY), beside)


def _from_outside(rng, cause, scene, visible, bases):
    cause = fit_into(cause, scene, visible, rng, *SEEN_OUTSIDE)
    return (cause,) if cause is not None and is_outside(cause, scene, visible, bases) else None


def _confounded(design, rng, scene, visible, swept, joint):
    if design == "small_workspace":
        cause = confounded.soft_arm(rng, scene, visible)
    else:
        cause = confounded.confused(rng, scene, visible, swept, joint)
    return None if cause is None else (cause,)


def _columns(campaign, causes, rng):
    """What is recorded: all that the causes need, most of the rest."""
    left_out = {name for cause in causes for name in cause.columns_left_out}
    needed = {name for cause in causes for name in cause.needs} | ({"payload"} if campaign.payload_kg.any() else set())
    return needed | {name for name in OPTIONAL if rng.random() < 0.7 and name not in left_out}
