"""What the tests of hindrax_bag share, also in a copy of src without the root of the repository."""

from importlib.util import find_spec

from hindrax_core.testing import load_profile

if find_spec("hindrax_ros"):  # the wheel is without it, and then without the tests of nodes
    from hindrax_ros.testing.fixtures import ros_domain  # noqa: F401

load_profile()
