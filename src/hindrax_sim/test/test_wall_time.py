"""Programs that sleep by the wall clock: what they waited has passed, and time never goes back."""

import pytest

from hindrax_core.events import Stamp
from hindrax_sim.mock_vehicle import WallTime

MS = 1_000_000


class Clocks:
    """A mock's clock in steps of 5 ms, and a wall clock."""

    def __init__(self) -> None:
        self.world, self.wall = 1_000 * MS, 77 * MS
        self.time = WallTime(lambda: Stamp(self.world), lambda: self.wall)


@pytest.fixture
def clocks() -> Clocks:
    return Clocks()


def test_a_sleep_of_the_caller_has_passed_though_the_mock_has_hardly_moved(clocks: Clocks) -> None:
    before = clocks.time.now()
    clocks.wall += 20 * MS
    clocks.world += 15 * MS
    assert clocks.time.now() - before == 20 * MS


def test_a_mock_that_runs_ahead_takes_time_along(clocks: Clocks) -> None:
    clocks.wall += 1 * MS
    clocks.world += 500 * MS
    assert clocks.time.now() == clocks.world


def test_time_never_goes_back_and_a_wait_is_a_wait_beside_a_mock_that_has_lost_seconds(clocks: Clocks) -> None:
    clocks.wall += 10_000 * MS
    far = clocks.time.now()
    assert clocks.time.now() == far
    clocks.wall += MS
    assert clocks.time.now() == far + MS
    clocks.world += 5 * MS
    assert clocks.time.now() == far + MS
