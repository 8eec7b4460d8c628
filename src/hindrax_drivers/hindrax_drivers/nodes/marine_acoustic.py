"""The DVL's detail also as marine_acoustic_msgs/Dvl, where that package is installed: field for field.

Definition of the message: github apl-ocean-engineering/marine_msgs, marine_acoustic_msgs/msg/Dvl.msg.
"""

from __future__ import annotations

from typing import Any

from hindrax_core.topics import SENSOR, Topic

TYPE = "marine_acoustic_msgs/msg/Dvl"
ALIKE = (
    *("header", "velocity_mode", "dvl_type", "velocity", "velocity_covar", "altitude", "course_gnd", "speed_gnd"),
    *("num_good_beams", "sound_speed", "beam_ranges_valid", "beam_velocities_valid"),
)
OF_BEAMS = {
    "beam_unit_vec": "unit_vec",
    "range": "range",
    "range_covar": "range_covar",
    "beam_quality": "quality",
    "beam_velocity": "velocity",
    "beam_velocity_covar": "velocity_covar",
}
"""Array of theirs, field of our beam."""


def fill(theirs: Any, ours: Any) -> Any:
    """Fill a marine_acoustic_msgs/Dvl from a hindrax_msgs/Dvl and return it."""
    for name in ALIKE:
        setattr(theirs, name, getattr(ours, name))
    for name, field in OF_BEAMS.items():
        setattr(theirs, name, [getattr(beam, field) for beam in ours.beams])
    return theirs


def topic_of(device: str) -> Topic:
    """Topic of the copy: `DEVICE/dvl`, not recorded."""
    return Topic(f"{device}/dvl", TYPE, SENSOR, 0.0, recorded=False, meaning="detail as marine_acoustic_msgs")
