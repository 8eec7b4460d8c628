"""What the tests of hindrax_bringup share, also in a copy of src without the root of the repository."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from hindrax_bringup.stack_lock import FOLDER
from hindrax_core.testing import load_profile
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ros.testing.fixtures import ros_domain

__all__ = ["ros_domain"]

load_profile()
# A shell ignores Ctrl-C for what it runs in the background, and all that the tests start would.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    """The Hindrax itself."""
    return load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")


@pytest.fixture(scope="session", autouse=True)
def runtime_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Stacks of the tests are announced apart from those of whoever works on this machine."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER, str(tmp_path_factory.mktemp("runtime")))
        yield
