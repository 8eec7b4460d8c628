"""Definitions by the text that bags embed, and by the installed classes: live and recorded messages are read alike."""

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_bag.definitions import definition
from hindrax_core.messages.definition import parsed
from hindrax_core.topics import TOPICS
from hindrax_ros.messages.serialization import definition_of, message_class
from hindrax_ros.messages.share import share_lookup


@pytest.mark.parametrize("kind", sorted({topic.type for topic in TOPICS}))
def test_the_definition_of_a_class_is_that_of_its_text(kind: str) -> None:
    assert definition_of(message_class(kind)) == parsed(kind, definition(kind, share_lookup))
