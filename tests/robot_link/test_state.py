"""What a controller says about its safety, by the numbers of the RTDE guide of Universal Robots."""

import pytest
from truepath.robot_link.state import safety_of


@pytest.mark.parametrize(
    ("mode", "bits", "name"),
    [
        (1, 1 << 0, "normal"),
        (2, 1 << 1, "reduced"),
        (3, 1 << 2 | 1 << 10, "protective_stop"),
        (5, 1 << 4 | 1 << 10, "safeguard_stop"),
        (7, 1 << 6 | 1 << 7 | 1 << 10, "emergency_stop"),
        (8, 1 << 8, "violation"),
        (9, 1 << 9 | 1 << 2, "fault"),
        (1, 1 << 2, "protective_stop"),  # the two may be a packet apart: the worse one counts
        (3, 1 << 0, "protective_stop"),
        (11, 0, "unknown"),
    ],
)
def test_the_worse_of_mode_and_bits_counts(mode, bits, name):
    assert safety_of(mode, bits) == name
