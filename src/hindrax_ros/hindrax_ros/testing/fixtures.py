"""Fixtures of the tests that join a ROS graph; a conftest imports them by name."""

from collections.abc import Iterator

import pytest

from hindrax_ros.free_domain import free_domain


@pytest.fixture(scope="session")
def ros_domain() -> Iterator[int]:
    """A ROS domain that no stack and no other worker on this machine uses."""
    with pytest.MonkeyPatch.context() as patch, free_domain() as domain:
        patch.delenv("ROS_DOMAIN_ID", raising=False)
        yield domain
