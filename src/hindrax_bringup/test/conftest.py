"""What the tests of hindrax_bringup share, also in a copy of src without the root of the repository."""

from collections.abc import Iterator

import pytest

from hindrax_bringup.stack import own_domain


@pytest.fixture(scope="session")
def ros_domain() -> Iterator[int]:
    """A ROS domain that no stack and no other worker on this machine uses."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("ROS_DOMAIN_ID", raising=False)
        with own_domain(mock=True) as domain:
            assert domain is not None
            yield domain
