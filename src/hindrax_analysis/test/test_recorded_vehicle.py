"""The vehicle of a bag: the file beside it, else the one inside it."""

import shutil
from pathlib import Path

import pytest

from hindrax_analysis.identification.record_identification import RecordSource, recorded_vehicle
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import load_vehicle

FILE = default_vehicle()


def bag(folder: Path, inside: bytes | None) -> RecordSource:
    made = BagWriter(folder / "bag", lambda _package, _name: "", limits=BagLimits(keep_free_MB=0.0))
    made.open()
    if inside is not None:
        made.attach("vehicle.yaml", "application/yaml", inside, 1)
    made.close()
    return RecordSource(folder / "bag")


def test_the_file_inside_a_bag_is_the_vehicle(tmp_path: Path) -> None:
    assert recorded_vehicle(bag(tmp_path, FILE.read_bytes())) == load_vehicle(FILE)


def test_the_file_beside_a_bag_goes_before_the_one_inside(tmp_path: Path) -> None:
    source = bag(tmp_path, b"name: [")
    with pytest.raises(UsageError, match=r"vehicle file vehicle\.yaml inside .*: is not YAML"):
        recorded_vehicle(source)
    shutil.copyfile(FILE, tmp_path / "vehicle.yaml")
    assert recorded_vehicle(source) == load_vehicle(FILE)


def test_a_bag_without_either_has_no_vehicle(tmp_path: Path) -> None:
    assert recorded_vehicle(bag(tmp_path, None)) is None
