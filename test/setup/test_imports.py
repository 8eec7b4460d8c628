"""What a restart in flight waits for: no onboard process imports the slow parts of scipy, or what it does not use."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest.importorskip("rclpy", reason="the processes import rclpy")

from hindrax_bringup.processes import CONTROL, IDENTIFIER, RECORDER, SENSORS, THRUSTERS, Process

SLOW = ("scipy.stats", "scipy.signal", "scipy.optimize", "scipy.interpolate", "matplotlib", "textual", "hindrax_sim")
"""Half a second and more each, at every start; `python -X importtime` shows who asks for them."""


@pytest.mark.parametrize("process", [SENSORS, THRUSTERS, CONTROL, IDENTIFIER, RECORDER], ids=lambda one: one.name)
def test_no_onboard_process_imports_what_is_slow(process: Process) -> None:
    code = f"import sys, {process.module}; print([one for one in {SLOW!r} if one in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
