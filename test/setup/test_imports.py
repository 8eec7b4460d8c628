"""What a start and a restart in flight wait for: nobody imports the slow parts of scipy, or what it does not use."""

import subprocess
import sys

import pytest

pytest.importorskip("rclpy", reason="the processes import rclpy")

from hindrax_bringup.processes import CONTROL, IDENTIFIER, RECORDER, SENSORS, THRUSTERS

SLOW = ("scipy.stats", "scipy.signal", "scipy.optimize", "scipy.interpolate", "matplotlib", "textual", "lark")
"""Up to half a second each, at every start; `python -X importtime` shows who asks for them."""
ONBOARD = [process.module for process in (SENSORS, THRUSTERS, CONTROL, IDENTIFIER, RECORDER)]


@pytest.mark.parametrize("module", [*ONBOARD, "hindrax_cli.commands.pool.pool_flight"])
def test_no_start_imports_what_is_slow(module: str) -> None:
    unwanted = (*SLOW, "hindrax_sim") if module in ONBOARD else SLOW
    # All nodes come from hindrax_ros; the type support of the first message is what they make next.
    message = "import hindrax_ros; from std_msgs.msg import Empty; type(Empty).__import_type_support__()"
    code = f"import sys, {module}; {message}; print([one for one in {unwanted!r} if one in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
