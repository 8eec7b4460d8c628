"""The tables of what a manual offers: every device has one, and what it names exists."""

import re

import pytest

from hindrax_core.sensor_table import SENSORS
from hindrax_core.topics import TOPICS
from hindrax_core.vehicle import Output
from hindrax_drivers.driver_registry import driver_of
from hindrax_tools.reference.devices import OUTPUTS, offers

NAMES = [sensor.name for sensor in SENSORS]
TOPIC_NAMES = {topic.name for topic in TOPICS}
SERVICES = {f"{sensor.name}/{service}" for sensor in SENSORS for service in sensor.services}


@pytest.mark.parametrize("name", [*NAMES, *OUTPUTS])
def test_every_device_states_what_its_manual_offers(name: str) -> None:
    rows = offers().get(name, [])
    assert rows, f"{name}: no table in offers.yaml of what its manual offers"
    assert any(served for _, _, served, _ in rows)
    assert all(what and page and how for what, page, _, how in rows)
    for _, _, _, how in rows:
        for word in re.findall(r"`([a-z0-9_]+/[a-z_]+)`", how):
            assert word in TOPIC_NAMES | SERVICES, f"{name}: {word} is no topic"
        for word in re.findall(r"parameters? `(\w+)`", how):
            assert hasattr(driver_of(name).knobs(), word), f"{name}: {word} is no parameter"
        for word in re.findall(r"`output\.(\w+)`", how):
            assert hasattr(Output(), word), f"{name}: {word} is no key of output"


def test_no_table_is_of_a_device_that_there_is_not() -> None:
    assert offers().keys() == {*NAMES, *OUTPUTS}
