"""What the tests of hindrax_laboratory share, also in a copy of src without the root of the repository."""

from hindrax_core.testing import load_profile

load_profile()
