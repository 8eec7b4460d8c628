"""A computer that stands still longer than the lease of the middleware (4 s): afterwards commands are obeyed again."""

import importlib.util
import os
import signal
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest

from hindrax_bringup.process_state import descendants
from hindrax_bringup.processes import CONTROL
from hindrax_core.errors import HindraxError
from hindrax_tools.faults.fault_outcome import DISARMED, HOLD
from hindrax_tools.faults.process_faults import PATIENT_S, FaultyStack, faulty_stack

LEASE_S = 4.0

pytestmark = [
    pytest.mark.ros,
    pytest.mark.long,
    pytest.mark.skipif(
        importlib.util.find_spec("hindrax_msgs") is None, reason="needs the built workspace: run ./hindrax test"
    ),
]


def stall(pids: Sequence[int], seconds: float) -> None:
    """Stop processes for a while; they continue in their order, supervisors first."""
    for number in (signal.SIGSTOP, signal.SIGCONT):
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, number)
        if number == signal.SIGSTOP:
            time.sleep(seconds)


def holds_again(stack: FaultyStack) -> bool:
    """Disarm, arm, hold a depth; whether there is thrust, also after the time in which silent ones are disarmed.

    What is refused while processes are starting is asked for again, as an operator would.
    """
    from hindrax_operator.nodes.orders import hold  # rclpy reads the environment as it is imported

    end_s = time.monotonic() + PATIENT_S
    while True:
        try:
            stack.prepare(DISARMED)
            stack.prepare(HOLD)
            hold(stack.operator, ["depth"], 0.8, engaged=True)
            break
        except HindraxError:
            if time.monotonic() > end_s:
                raise
    stack.operator.pause(6.0)
    return not stack.neutral and stack.operator.armed and not stack.operator.unobeyed


def test_after_a_stall_of_control_and_of_all_commands_are_obeyed_again(tmp_path: Path) -> None:
    with faulty_stack(tmp_path, 1, record=False) as stack:
        assert holds_again(stack)
        # While control and its supervisor stand still, the others lose control for sure.
        control = stack.pids(CONTROL.name)
        above = [pid for pid in descendants(os.getpid()) if control[0] in descendants(pid)]
        stall([*above, *control], LEASE_S + 1.0)
        assert holds_again(stack)
        stall(descendants(os.getpid()), 2.0 * LEASE_S)
        assert holds_again(stack)
