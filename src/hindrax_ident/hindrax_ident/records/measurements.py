"""Topics of the identification, and the measurement in each message; the same live and over a bag."""

from functools import partial
from typing import cast

from hindrax_core import topics
from hindrax_core.messages.contents import NAVIGATION, PHASE, THRUST, Contents, of_sensor
from hindrax_core.sensor_table import Capability
from hindrax_core.topics import Topic
from hindrax_core.vehicle import Vehicle
from hindrax_ident.records.feed import WALL_SONARS, Measurement, WallRange, wall_sonars

MEASURED: tuple[Capability, ...] = ("velocity", "depth")


def measurements(vehicle: Vehicle) -> dict[Topic, Contents[Measurement]]:
    """Topics that the identification of a vehicle reads, and what the messages of each hold."""
    first = (next(iter(topics.carriers(vehicle, capability).values())) for capability in MEASURED)
    sensors: dict[Topic, Contents[Measurement]] = {
        topic: cast("Contents[Measurement]", of_sensor(topic)) for topic in first
    }
    for name in wall_sonars(vehicle):
        topic = next(carriers[name] for looks in WALL_SONARS if name in (carriers := topics.carriers(vehicle, looks)))
        sensors[topic] = Contents(("range",), partial(_wall_range, name))
    return sensors | {topics.NAVIGATION: NAVIGATION, topics.ALLOCATION: THRUST, topics.MANEUVER: PHASE}


def _wall_range(sensor: str, range_m: float) -> WallRange:
    return WallRange(range_m, sensor)
