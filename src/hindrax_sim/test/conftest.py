"""What the tests of hindrax_sim share, also in a copy of src without the root of the repository."""

import sys
from pathlib import Path

import pytest

from hindrax_core.testing import load_profile
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ros.testing.fixtures import ros_domain

__all__ = ["ros_domain"]

load_profile()
sys.path.insert(0, str(Path(__file__).parent))  # the helpers of these tests


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    """The Hindrax itself."""
    return load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
