"""One value of a vehicle file is changed, and nothing else."""

from pathlib import Path

import pytest
import yaml

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.testing.vehicle_files import hindrax_file
from hindrax_cli.vehicle_edit import edited, set_key
from hindrax_core.errors import UsageError

TEXT = """\
# a vehicle
water: {density_kgpm3: 1000.0, surface_pressure_Pa: 101325.0}   # of the pool
sensors:
  # first of all
  imu: {device: icm20948, port: /dev/i2c-1}
  depth:
    device: ms5837   # Bar30
    port: /dev/i2c-1
empty: {}
"""


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("water", "surface_pressure_Pa"), 98765.4),
        (("water", "new"), 1.5),
        (("sensors", "imu", "calibration"), {"mag_offset_T": [1e-06, 2.0, 3.0]}),
        (("sensors", "depth", "address"), 118),
        (("sensors", "depth", "device"), "other"),
        (("empty", "first"), [1, 2]),
        (("top",), True),
    ],
)
def test_the_value_is_there_and_all_else_is_as_it_was(keys: tuple[str, ...], value: object) -> None:
    changed = edited(TEXT, keys, value, "file")
    wanted = yaml.safe_load(TEXT)
    block = wanted
    for key in keys[:-1]:
        block = block[key]
    block[keys[-1]] = value
    assert yaml.safe_load(changed) == wanted
    for comment in ("# a vehicle", "# of the pool", "# first of all", "# Bar30"):
        assert comment in changed


CURVE = """\
curves:
  main:
    source: table 2      # of the paper
    negative: {c: [1.0, 2.0], from_us: 1100.0}
    supply_V: 14.8       # at full charge

# Prior for plans.
hydrodynamics: {surge: 1.0}
"""


def test_a_block_stays_a_block_and_the_comments_below_it_stay() -> None:
    value = {"negative": {"c": [3.0, 4.0], "from_us": 1200.0}, "supply_V": 12.0}
    changed = edited(CURVE, ("curves", "main"), value, "file")
    assert (
        changed
        == """\
curves:
  main:
    negative:
      c: [3.0, 4.0]
      from_us: 1200.0
    supply_V: 12.0       # at full charge

# Prior for plans.
hydrodynamics: {surge: 1.0}
"""
    )
    assert edited(changed, ("curves", "main"), value, "file") == changed


def test_setting_twice_is_setting_once() -> None:
    once = edited(TEXT, ("sensors", "imu", "calibration"), {"a": [1.0]}, "file")
    assert edited(once, ("sensors", "imu", "calibration"), {"a": [1.0]}, "file") == once


def test_a_missing_block_is_named() -> None:
    with pytest.raises(UsageError, match=r"file: found no block sensors.sonar"):
        edited(TEXT, ("sensors", "sonar", "port"), "x", "file")


def test_a_value_the_vehicle_would_refuse_is_not_written(tmp_path: Path) -> None:
    file = hindrax_file(tmp_path)
    with pytest.raises(UsageError, match=r"water.surface_pressure_Pa: found 5"):
        set_key(file, ("water", "surface_pressure_Pa"), 5)
    assert file.read_text() == default_vehicle().read_text()
    with pytest.raises(UsageError, match="cannot be changed"):
        set_key(tmp_path / "none.yaml", ("name",), "x")
