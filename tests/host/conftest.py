import pytest
from foreign_host import RealCell, build_plant, calibrated, plugin_for


@pytest.fixture(scope="session")
def plant():
    """The host's plant. Nobody may change it."""
    return build_plant()


@pytest.fixture(scope="session")
def drawn():
    """The cell as it is drawn, for what a program means."""
    return RealCell()


@pytest.fixture(scope="session")
def rigid_cell():
    """The real cell, nothing but geometry being wrong."""
    return RealCell(seed=3)


@pytest.fixture(scope="session")
def soft_cell():
    """The real cell, with joints that bend besides."""
    return RealCell(seed=4, soft=True)


@pytest.fixture(scope="session")
def rigid(plant, rigid_cell):
    """Calibrated with the rigid cell."""
    return calibrated(plant, rigid_cell)


@pytest.fixture(scope="session")
def soft(plant, soft_cell):
    """Calibrated with the soft cell, the bending of joints being among what was asked for."""
    return calibrated(plant, soft_cell, ("joint_compliance",))


@pytest.fixture
def fresh(plant):
    """A plugin without a calibration."""
    return plugin_for(plant)
