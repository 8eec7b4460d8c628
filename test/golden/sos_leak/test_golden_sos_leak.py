"""A leak probe against what ArduSub's parameters say of such probes."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from hindrax_core.bus_operations import DeviceError, Read, Write
from hindrax_core.events import Rejected, Stamp
from hindrax_core.testing import rehearse
from hindrax_drivers.devices.sos_leak import RESTLESS_LOOKS, SosLeak, SosLeakKnobs

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())
LINE = CASES["line"]


def configured(**knobs: Any) -> SosLeak:
    sensor = SosLeak(SosLeakKnobs(looks=3, **knobs))
    rehearse(sensor.configure(), [(Write(LINE, b"\x01"), b"")])
    return sensor


def looks(sensor: SosLeak, levels: str) -> list[Any]:
    """What is said at each look."""
    found = (rehearse(sensor.cycle(Stamp(0)), [(Read(LINE, 1), bytes([int(level)]))]) for level in levels)
    return [one[0] if one else None for one in found]


@pytest.mark.parametrize("row", CASES["samples"], ids=lambda row: row["what"])
def test_a_level_is_accepted_after_some_looks(row: dict[str, Any]) -> None:
    *before, last = looks(configured(wet_level=row["wet_level"]), 3 * str(row["level"]))
    assert before == [None, None]
    assert last.reading.wet is row["wet"]


def test_a_splash_of_noise_is_no_leak_and_water_is() -> None:
    found = looks(configured(), "0001000111")
    assert isinstance(found[3], Rejected)
    assert [one.reading.wet for one in found if one is not None and not isinstance(one, Rejected)] == [
        False,
        False,
        True,
    ]


@pytest.mark.parametrize("before", ["", "111"])
def test_a_line_that_never_rests_is_no_probe(before: str) -> None:
    sensor, patience = configured(), RESTLESS_LOOKS + 3
    looks(sensor, before)
    looks(sensor, (patience * "01")[:patience])
    with pytest.raises(DeviceError, match="line 27: changes all the time"):
        looks(sensor, str(patience % 2))


def test_a_line_that_rests_now_and_then_is_one() -> None:
    sensor = configured()
    for _ in range(RESTLESS_LOOKS):
        *_, last = looks(sensor, "0101000")
        assert last.reading.wet is False


def test_a_line_that_is_set_up_again_is_looked_at_anew() -> None:
    sensor = configured()
    looks(sensor, "01" * (RESTLESS_LOOKS // 2) + "111")
    rehearse(sensor.configure(), [(Write(LINE, b"\x01"), b"")])
    assert looks(sensor, "00") == [None, None]
