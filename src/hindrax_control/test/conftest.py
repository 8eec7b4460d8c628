"""What the tests of control share."""

import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from hindrax_control.testing.ideal_vehicle import IdealVehicle
from hindrax_core.testing import load_profile
from hindrax_core.vehicle import Vehicle, load_vehicle

if find_spec("hindrax_ros"):  # the wheel is without it, and then without the tests of nodes
    from hindrax_ros.testing.fixtures import ros_domain  # noqa: F401

load_profile()
sys.path.insert(0, str(Path(__file__).parent))  # the helpers of these tests


@pytest.fixture(scope="session")
def ideal_vehicle() -> type[IdealVehicle]:
    """The class of ideal vehicles."""
    return IdealVehicle


@pytest.fixture(scope="session")
def hindrax() -> Vehicle:
    """The Hindrax itself."""
    return load_vehicle(Path(__file__).parents[2] / "hindrax_bringup" / "vehicles" / "hindrax.yaml")


@pytest.fixture(scope="session")
def vehicle(hindrax: Vehicle) -> Vehicle:
    """The same, as the tests of every package call it."""
    return hindrax
