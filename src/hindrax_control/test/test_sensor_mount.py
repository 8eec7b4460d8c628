"""Where a sensor sits: its axes in those of the body, and whether it sits elsewhere than at the origin."""

import pytest

from hindrax_control.sensors import NOWHERE, SensorMount
from hindrax_core.readings import Vec3
from hindrax_core.vehicle import Mount

Y: Vec3 = (0.0, 1.0, 0.0)
SENSED: Vec3 = (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("rotation_deg", "in_body", "axis"),
    [
        ((0.0, 0.0, 0.0), SENSED, (0.0, 0.0, 1.0)),
        ((180.0, 0.0, 0.0), (1.0, -2.0, -3.0), (0.0, 0.0, -1.0)),  # upside down
        ((0.0, 90.0, 0.0), (3.0, 2.0, -1.0), (1.0, 0.0, 0.0)),  # its z looks ahead, its x up
        ((0.0, 0.0, 90.0), (-2.0, 1.0, 3.0), (0.0, 0.0, 1.0)),  # its x looks to starboard
        ((90.0, 0.0, 90.0), (3.0, 1.0, 2.0), (1.0, 0.0, 0.0)),  # rolled, then yawed
    ],
)
def test_a_vector_of_the_sensor_in_body_axes(rotation_deg: Vec3, in_body: Vec3, axis: Vec3) -> None:
    mount = SensorMount(Mount("dvl75", rotation_deg=rotation_deg))
    assert mount.body(SENSED) == pytest.approx(in_body)
    assert mount.axis == pytest.approx(axis)
    assert mount.body((0.0, 0.0, 1.0)) == pytest.approx(axis)


def test_a_sensor_is_away_from_the_origin_when_any_coordinate_reports_it() -> None:
    assert [SensorMount(Mount("dvl75", position_m=at)).away for at in ((0.0, 0.0, 0.0), Y)] == [False, True]
    assert SensorMount(Mount("dvl75", position_m=Y)).lever_m == Y
    assert not NOWHERE.away
