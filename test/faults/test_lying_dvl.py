"""A DVL that is turned or scaled in flight: thrust ends before the state is wrong, and the sensor is named."""

import pytest

from hindrax_sim.faults.fault_registry import FaultSpec
from hindrax_tools.faults.device_faults import ModePilot, watched
from hindrax_tools.faults.fault_outcome import LONGEST_WRONG_S, MANEUVER, OPERATOR

FROM_S = {MANEUVER: 28.0, OPERATOR: 18.0}
"""When it moves: at rest a turned or scaled velocity is the true one, zero."""


@pytest.mark.parametrize("mode", [MANEUVER, OPERATOR])
@pytest.mark.parametrize("fault", ["velocity_turned", "velocity_scaled"])
def test_it_is_found_before_it_harms(fault: str, mode: str) -> None:
    found = watched(ModePilot(mode, 0), [FaultSpec(fault, ("dvl75",), FROM_S[mode], 99.0)], 0, FROM_S[mode] + 4.0)
    assert found.reason.startswith(("velocity: ", "gain: "))
    assert not found.judge.flies_on
    cell = found.judge.cell("dvl75", fault, mode, 0, found.reason)
    assert cell.wrong_s < LONGEST_WRONG_S
    assert not cell.violated
