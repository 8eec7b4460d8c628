"""What the tests of hindrax_bag share, also in a copy of src without the root of the repository."""

from hindrax_core.testing import load_profile
from hindrax_ros.testing.fixtures import ros_domain

__all__ = ["ros_domain"]

load_profile()
