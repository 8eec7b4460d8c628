"""What a bag says of itself: whether it is of the mock, and what was true there."""

import json
from pathlib import Path

from hindrax_analysis.records.own_bag import is_mock, seed_of, truth_in
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.events import Stamp
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.assess.results import truth_of

VEHICLE = load_vehicle(default_vehicle())


def bag(folder: Path, **reported: str) -> Path:
    writer = BagWriter(folder, lambda _package, _name: "")
    writer.open()
    writer.describe("hindrax", reported)
    writer.attach("vehicle.yaml", "application/yaml", b"", Stamp(1))
    writer.close()
    return folder


def test_the_truth_of_a_bag_is_that_of_the_hull_which_flew(tmp_path: Path) -> None:
    hull = {"surge": {"k_q": 60.0}}
    reported = bag(tmp_path / "reported", notes="pool-test surge in mock, seed 7", truth=json.dumps(hull))
    assert is_mock(reported)
    assert seed_of(reported) == 7
    assert truth_in(reported, VEHICLE) == hull


def test_a_bag_without_truth_takes_that_of_the_vehicle_file(tmp_path: Path) -> None:
    for name, reported in (("old", {"notes": "in mock"}), ("real", {"notes": "", "truth": ""})):
        found = bag(tmp_path / name, **reported)
        assert truth_in(found, VEHICLE) == truth_of(VEHICLE)
        assert seed_of(found) is None
