"""What every test run has in common."""

from hypothesis import settings

# A busy machine is slow, not wrong: properties are judged by what they find, never by the clock.
settings.register_profile("hindrax", deadline=None)
settings.load_profile("hindrax")
