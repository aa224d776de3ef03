"""What the paper states and what is required of truepath.

The paper: Y. Jiang, L. Yu, H. Jia, H. Zhao, H. Xia, "Absolute Positioning Accuracy Improvement in an Industrial
Robot", Sensors 2020. Its prose and its tables disagree; the tables are taken.
"""

from __future__ import annotations

from dataclasses import dataclass, field

POSES_TO_FIT = {"simulation": 1000, "experiment": 600}
POSES_TO_VERIFY = 100
BEFORE_MM = 0.7411  # mean positioning error of the paper's simulated robot

ROWS = {
    "before": "before",
    "kinematic": "POE + LM",
    "direct": "the paper's network alone",
    "kinematic+network": "POE + LM + network",
    "named": "POE + LM + named causes",
    "all": "all of truepath",
}
STATISTICS = ("mean", "max")


@dataclass(frozen=True)
class PaperTable:
    """A table of the paper and the figure that belongs to it.

    Attributes:
        number, figure: as the paper counts them.
        protocol: ``simulation`` or ``experiment``.
        quantity: field of ``iso9283.Accuracy``.
        values_mm: row to its mean and maximum.
    """

    number: int
    figure: int
    protocol: str
    quantity: str
    values_mm: dict[str, tuple[float, float]] = field(hash=False)

    @property
    def kind(self) -> str:
        return self.quantity.removesuffix("_mm")

    @property
    def title(self) -> str:
        robot = {"simulation": "simulation", "experiment": "experiment (a real UR5)"}[self.protocol]
        return f"{'positioning' if self.kind == 'position' else 'distance'} accuracy, {robot}"

    def value_mm(self, row: str, statistic: str) -> float | None:
        values = self.values_mm.get(row)
        return None if values is None else values[STATISTICS.index(statistic)]


TABLES = (
    PaperTable(
        *(1, 8, "simulation", "position_mm"),
        {"before": (0.7411, 2.9500), "kinematic": (0.3611, 1.1379), "direct": (0.1007, 0.6803)},
    ),
    PaperTable(
        *(2, 9, "simulation", "distance_mm"),
        {"before": (1.1180, 3.1760), "kinematic": (0.4461, 1.3360), "direct": (0.1564, 0.7743)},
    ),
    PaperTable(
        *(3, 13, "experiment", "position_mm"),
        {"before": (1.7730, 3.9930), "kinematic": (0.2595, 0.9877), "direct": (0.1041, 0.6559)},
    ),
    PaperTable(
        *(4, 14, "experiment", "distance_mm"),
        {"before": (0.8497, 2.0140), "kinematic": (0.1915, 0.4113), "direct": (0.0493, 0.2392)},
    ),
)


@dataclass(frozen=True)
class Requirement:
    """A median that is to be reached; ``noise_mm`` None stands for every noise that was run."""

    protocol: str
    row: str
    quantity: str
    statistic: str
    most_mm: float
    noise_mm: float | None = None


REQUIREMENTS = (
    Requirement("simulation", "direct", "position_mm", "mean", 0.101),
    Requirement("simulation", "direct", "position_mm", "max", 0.68),
    Requirement("simulation", "all", "position_mm", "mean", 0.010, noise_mm=0.0),
    Requirement("simulation", "all", "position_mm", "mean", 0.015, noise_mm=0.03),
    Requirement("experiment", "all", "position_mm", "mean", 0.056),
    Requirement("experiment", "all", "position_mm", "max", 0.20),
    Requirement("experiment", "all", "distance_mm", "mean", 0.045),
)
