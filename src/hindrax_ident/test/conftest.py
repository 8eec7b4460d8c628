"""What the tests of the identification share."""

from pathlib import Path

import pytest

from hindrax_core.vehicle import load_vehicle

VEHICLE_FILE = Path(__file__).parents[2] / "hindrax_bringup" / "vehicles" / "hindrax.yaml"


@pytest.fixture(scope="session")
def vehicle():
    return load_vehicle(VEHICLE_FILE)
