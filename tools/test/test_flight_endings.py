"""Endings of flights with faults: what is drawn, what counts as unsafe, and the table."""

import pytest

from hindrax_bringup.share_files import default_vehicle
from hindrax_core.vehicle import load_vehicle
from hindrax_tools.flight_endings import DONE, REFUSED, Ending, Fault, drawn, table

HINDRAX = load_vehicle(default_vehicle())


def test_every_kind_of_fault_is_drawn_and_the_same_one_for_the_same_seed() -> None:
    kinds = {drawn(seed, HINDRAX).name for seed in range(7)}
    assert len(kinds) == 7
    assert drawn(11, HINDRAX) == drawn(11, HINDRAX)


@pytest.mark.parametrize(
    ("how", "wall_hits", "unsafe"),
    [(DONE, 0, False), (DONE, 1, True), (REFUSED, 1, True), ("blocked: 18 N", 2, False)],
)
def test_a_wall_that_no_guard_noticed_is_unsafe(how: str, wall_hits: int, unsafe: bool) -> None:
    assert Ending("lbv", "surge", Fault("current"), 1, how, wall_hits).unsafe is unsafe


def test_the_table_counts_guards_by_name() -> None:
    ends = [(DONE, 0), ("pool_box: 0.3 m", 0), ("pool_box: 0.2 m", 1)]
    endings = [Ending("lbv", "surge", Fault("current"), 1, how, hits) for how, hits in ends]
    assert table(endings).splitlines()[2:] == ["| current | 3 | 1 | pool_box 2 | 1 |"]
