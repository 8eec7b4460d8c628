"""Topics of the identification, and the measurement in each message; the same live and over a bag."""

from hindrax_core import topics
from hindrax_core.messages.contents import NAVIGATION, PHASE, THRUST, Contents, of_sensor
from hindrax_core.sensor_table import Capability
from hindrax_core.topics import Topic
from hindrax_core.vehicle import Vehicle

MEASURED: tuple[Capability, ...] = ("velocity", "depth")


def measurements(vehicle: Vehicle) -> dict[Topic, Contents]:
    """Topics that the identification of a vehicle reads, and what the messages of each hold."""
    first = (next(iter(topics.carriers(vehicle, capability).values())) for capability in MEASURED)
    sensors = {topic: of_sensor(topic) for topic in first}
    return sensors | {topics.NAVIGATION: NAVIGATION, topics.ALLOCATION: THRUST, topics.MANEUVER: PHASE}
