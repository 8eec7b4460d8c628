"""What the tests of hindrax_ident share, also in a copy of src without the root of the repository."""

from pathlib import Path

import pytest

from hindrax_core.testing import load_profile
from hindrax_core.vehicle import Vehicle, load_vehicle

load_profile()


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    """The Hindrax itself."""
    return load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
