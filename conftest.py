"""What every test run has in common."""

import os

from hypothesis import settings

# A busy machine is slow, not wrong: properties are judged by what they find, never by the clock. The usual run tries
# the same examples every time, so that it tells of the change at hand; a thorough one looks for new ones.
settings.register_profile("hindrax", deadline=None, derandomize="HINDRAX_THOROUGH" not in os.environ)
settings.load_profile("hindrax")
