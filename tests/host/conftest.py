import gc

import pytest
from foreign_host import RealCell, build_plant, calibrated, plugin_for
from live_host import Browser, make_host, start_meshcat


@pytest.fixture(scope="module", autouse=True)
def _nothing_of_drake_is_left():
    """Drake's Meshcat must die on the thread that made it; garbage is also collected on the threads of later tests."""
    yield
    gc.collect()


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


@pytest.fixture(scope="session")
def meshcat():
    """The host's, with something of its own in it."""
    return start_meshcat()


@pytest.fixture(scope="session")
def host(meshcat, rigid_cell):
    """A diagram of the host that draws itself, and the plugin for its right arm, which does not know the shapes."""
    return make_host(meshcat, rigid_cell)


@pytest.fixture
def browser(meshcat):
    """What a browser would send, and what it was told."""
    return Browser(meshcat)


@pytest.fixture
def operate(host):
    """Function: shows a path and gives the controls."""

    def operate(program, **options):
        return host.plugin.operate(program, scene_graph=host.scene_graph, **options)

    yield operate
    host.plugin.remove()
