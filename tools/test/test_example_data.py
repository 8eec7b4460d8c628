"""The example log is one that the tool reads: parameters, outputs, velocities."""

from pathlib import Path

import numpy as np
import pytest

from hindrax_analysis.records.autopilot_log import read_log
from hindrax_analysis.records.autopilot_vehicle import logged_wiring
from hindrax_core.vehicle import load_vehicle
from hindrax_tools.ardusub import HEAVY, STEP_S, flight
from hindrax_tools.example_data import SEED, VELOCITY_NOISE_mps, dataflash

SECONDS = 30.0


def test_the_log_holds_the_flight(tmp_path: Path) -> None:
    file = tmp_path / "dive.bin"
    file.write_bytes(b"".join(dataflash(SECONDS, SEED)))
    wiring = logged_wiring([file])
    assert wiring is not None
    assert wiring.kind == "bluerov2-heavy"
    (found,) = read_log(file, load_vehicle(HEAVY))
    assert found.duration_s == pytest.approx(SECONDS, abs=2.0 * STEP_S)
    moved = found.velocity[np.isfinite(found.velocity[:, 0])][:, 0]
    flown = np.array([speeds["surge"] for _, speeds in flight(SECONDS)])
    assert float(np.std(moved - flown)) == pytest.approx(VELOCITY_NOISE_mps, rel=0.2)
    assert float(np.std(flown)) > 10.0 * VELOCITY_NOISE_mps
