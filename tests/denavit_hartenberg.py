"""Denavit and Hartenberg by hand: arms from tables, and tables from axes in space."""

import numpy as np

ALPHA = (np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0)
# Universal Robots, "DH Parameters for calculations of kinematics and dynamics": d1, a2, a3, d4, d5, d6 in metres.
PUBLISHED = {
    "UR3": (0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819),
    "UR5": (0.089159, -0.42500, -0.39225, 0.10915, 0.09465, 0.0823),
    "UR10": (0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922),
    "UR3e": (0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
    "UR5e": (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
    "UR10e": (0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
    "UR16e": (0.1807, -0.4784, -0.36, 0.17415, 0.11985, 0.11655),
    "UR20": (0.2363, -0.8620, -0.7287, 0.2010, 0.1593, 0.1543),
    "UR30": (0.2363, -0.6370, -0.5037, 0.2010, 0.1593, 0.1543),
}


def table(model):
    """``(6, 4)`` rows theta, a, d, alpha."""
    d1, a2, a3, d4, d5, d6 = PUBLISHED[model]
    return np.array([(0, a, d, alpha) for a, d, alpha in zip((0, a2, a3, 0, 0, 0), (d1, 0, 0, d4, d5, d6), ALPHA)])  # noqa: B905


def step(theta, a, d, alpha):
    """Rz(theta) Tz(d) Tx(a) Rx(alpha), written out."""
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])


def frames(rows, q):
    """The seven frames from base to flange."""
    found = [np.eye(4)]
    for (theta, a, d, alpha), angle in zip(rows, q, strict=True):
        found.append(found[-1] @ step(theta + angle, a, d, alpha))
    return found


def flange_poses(rows, q_rad):
    return np.array([frames(rows, q)[-1] for q in np.atleast_2d(q_rad)])


def table_of(axes, flange, like):
    """The table of an arm from a frame on each axis (z along it), the first being the base, and its flange at zero.

    The flange must lie on the last axis. Where two axes are nearly parallel their common normal is anywhere, and
    lengths along them are metres; of its two directions the one is taken that the arm ``like`` has.
    """
    rows, here = [], np.eye(4)
    for i in range(6):
        z = here[:3, 2]
        if i < 5:
            z_next, between = axes[i + 1][:3, 2], axes[i + 1][:3, 3] - here[:3, 3]
            normal = np.cross(z, z_next)
            square = normal @ normal
            foot = here[:3, 3] + z * (np.cross(between, z_next) @ normal) / square
            origin = axes[i + 1][:3, 3] + z_next * (np.cross(between, z) @ normal) / square
            x = normal / np.sqrt(square)
            x = x * np.sign(x @ frames(like, np.zeros(6))[i + 1][:3, 0])
        else:
            z_next, origin, x = flange[:3, 2], flange[:3, 3], flange[:3, 0]
            foot = origin
        theta = np.arctan2(np.cross(here[:3, 0], x) @ z, here[:3, 0] @ x)
        alpha = np.arctan2(np.cross(z, z_next) @ x, z @ z_next)
        rows.append((theta, (origin - foot) @ x, (foot - here[:3, 3]) @ z, alpha))
        here = np.eye(4)
        here[:3] = np.column_stack([x, np.cross(z_next, x), z_next, origin])
    return np.array(rows)


def askew(model, seed):
    """An arm of which axes 2 to 6 are 0.5 mm and 2 mrad off, as a function of joints; and its frames at zero."""
    rng = np.random.default_rng(seed)
    rows, errors = table(model), []
    for _ in range(5):
        error = np.eye(4)
        x, y = rng.normal(scale=2e-3, size=2)
        error[:3, :3] = [[1, 0, y], [x * y, 1, -x], [-y, x, 1]]
        u, _, v = np.linalg.svd(error[:3, :3])
        error[:3, :3], error[:2, 3] = u @ v, rng.normal(scale=5e-4, size=2)
        errors.append(error)

    def chain(q):
        X, axes = np.eye(4), []
        for i, ((theta, a, d, alpha), angle) in enumerate(zip(rows, q, strict=True)):
            X = X if i == 0 else X @ errors[i - 1]
            axes.append(X)
            X = X @ step(theta + angle, a, d, alpha)
        return axes, X

    axes, flange = chain(np.zeros(6))
    return (lambda q_rad: np.array([chain(q)[1] for q in np.atleast_2d(q_rad)])), table_of(axes, flange, rows)


def calibration_conf(model, rows):
    """Text of a ``calibration.conf`` as a controller writes it, that makes a robot of this model an arm of a table."""
    names = ("delta_theta", "delta_a", "delta_d", "delta_alpha")
    lines = [
        f"{name} = [ {', '.join(repr(float(x)) for x in delta)}]"
        for name, delta in zip(names, (rows - table(model)).T, strict=True)
    ]
    return "\n".join(
        [
            "[mounting]",
            *lines,
            "joint_checksum = [ 0x1, 0x2, 0x3, 0x4, 0x5, 0x6]",
            "calibration_status = 2 # 0 == notInitialized / 1 == notLinearised / 2 == Linearised",
            "joint_raw_offset = [ 0x31aa98, 0x324a55, 0xd4b163, 0xdd705d, 0xdce343, 0xdce0d7]",
            "",
        ]
    )
