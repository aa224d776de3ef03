"""The load on the flange, against what Drake says of the same cell."""

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from truepath import plants
from truepath.controller import controller_of
from truepath.deploying.load import Load, calibrated_load


@pytest.fixture(scope="module")
def drawn():
    """Mass, and centre in the flange, of the tool with its reflector."""
    plant: MultibodyPlant = plants.load_plant("ur5_cell")
    bodies = [plant.GetBodyByName(name).index() for name in ("tool", "reflector")]
    inertia = plant.CalcSpatialInertia(plant.CreateDefaultContext(), plant.GetFrameByName("flange"), bodies)
    return inertia.get_mass(), inertia.get_com()


def test_the_tool_of_the_calibrated_cell_is_its_load(calibration, drawn):
    load = calibrated_load(calibration, controller_of(calibration.model.robot))
    assert load.mass_kg == pytest.approx(drawn[0], abs=1e-9)
    assert load.centre_m == pytest.approx(drawn[1], abs=1e-9)


def test_a_payload_beyond_the_model_sits_on_the_flange(calibration, drawn):
    load = calibrated_load(calibration.carrying(2.0), controller_of(calibration.model.robot))
    assert load.mass_kg == pytest.approx(drawn[0] + 2.0, abs=1e-9)
    assert load.centre_m == pytest.approx(drawn[1] * drawn[0] / (drawn[0] + 2.0), abs=1e-9)


@pytest.mark.parametrize(
    ("mass_kg", "centre_m", "like"),
    [
        (1.03, [0.030, 0.0, 0.036], True),
        (0.86, [0.050, 0.0, 0.037], True),  # the reflector taken off
        (0.86, None, True),
        (1.60, [0.030, 0.0, 0.036], False),
        (0.0, [0.0, 0.0, 0.0], False),
        (float("nan"), None, False),
        (1.03, [0.030, 0.0, 0.136], False),
    ],
)
def test_a_load_is_like_another_if_gravity_does_the_same(mass_kg, centre_m, like):
    wanted = Load(1.03, np.array([0.030, 0.0, 0.036]))
    assert Load(mass_kg, None if centre_m is None else np.array(centre_m)).is_like(wanted) is like
