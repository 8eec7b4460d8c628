"""What starts, restarts in flight and an operator wait for: nobody imports what is slow, or what it does not use."""

import pkgutil
import subprocess
import sys

import pytest

pytest.importorskip("rclpy", reason="the processes import rclpy")

from hindrax_bringup.processes import CONTROL, IDENTIFIER, RECORDER, SENSORS, THRUSTERS
from hindrax_cli.commands import operate

SLOW = ("scipy.stats", "scipy.signal", "scipy.optimize", "scipy.interpolate", "matplotlib", "textual", "lark")
"""Up to half a second each, at every start; `python -X importtime` shows who asks for them."""
ONBOARD = [process.module for process in (SENSORS, THRUSTERS, CONTROL, IDENTIFIER, RECORDER)]
OPERATE = [one.name for one in pkgutil.iter_modules(operate.__path__, f"{operate.__name__}.")]
AT_HAND = [*OPERATE, "hindrax_cli.commands.machine.vehicle", "hindrax_cli.commands.pool.pool_flight"]
"""Commands that a person waits for, beside a vehicle: a fit brings its SciPy when it begins."""


@pytest.mark.parametrize("module", [*ONBOARD, ", ".join(AT_HAND)], ids=[*ONBOARD, "commands"])
def test_no_start_imports_what_is_slow(module: str) -> None:
    unwanted = (*SLOW, "scipy", *(["hindrax_sim"] if module in ONBOARD else []))
    # All nodes come from hindrax_ros; the type support of the first message is what they make next.
    message = "import hindrax_ros; from std_msgs.msg import Empty; type(Empty).__import_type_support__()"
    code = f"import sys, {module}; {message}; print([one for one in {unwanted!r} if one in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_dead_man_that_shares_no_memory_imports_little() -> None:
    unwanted = ("rclpy", "numpy", "importlib.metadata", "email", "hashlib")
    code = f"import sys, hindrax_drivers.nodes.deadman; print([one for one in {unwanted!r} if one in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
