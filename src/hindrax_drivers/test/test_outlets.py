"""What becomes of readings that only some devices of a kind give."""

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Range

from hindrax_bringup.vehicles import default_vehicle
from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import BottomTrack, Echo
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.nodes import outlets


def test_the_altitude_of_either_dvl_is_published(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[tuple[str, Any]] = []
    monkeypatch.setattr(
        outlets,
        "publisher",
        lambda _, topic: SimpleNamespace(publish=lambda message: said.append((topic.name, message))),
    )
    monkeypatch.setattr(outlets.marine_acoustic, "outlet", lambda _: None)
    made = outlets.outlets(SimpleNamespace(get_name=lambda: "dvl75"), load_vehicle(default_vehicle()))  # type: ignore[arg-type]
    track = BottomTrack(True, 0.0, 0.0, 0.0, 1.5, (0.0, 0.0), (), "3333", 0)
    made[BottomTrack](Stamped(Stamp(0), track))
    made[Echo](Stamped(Stamp(0), Echo(1.25, 0.9)))
    told = [deserialize_message(message, Range) for name, message in said if name == "dvl75/altitude"]
    assert [one.range for one in told] == [1.5, 1.25]
