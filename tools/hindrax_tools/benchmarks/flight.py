"""How fast the surge run flies through the whole stack in mock, beside real time."""

import contextlib
import io
import json
import tempfile

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions
from hindrax_operator.pool_run import ABORT, PoolOptions, run_pool_test
from hindrax_tools.benchmarks import row

SEED = 7


def rows() -> list[dict[str, object]]:
    """One row: wall time [us] of a second of the vehicle, from arming to disarming."""
    output = io.StringIO()
    with tempfile.TemporaryDirectory() as place, contextlib.redirect_stdout(output):
        run_pool_test(
            PoolOptions(
                motions=("surge",),
                vehicle_file=default_vehicle(),
                mock=MockOptions(seed=SEED),
                out=f"{place}/run",
                seed=SEED,
                excitation="plateaus",
                on_cancel="neutral",
                without_record=ABORT,
                headless=True,
                json=True,
            )
        )
    factor = float(json.loads(output.getvalue())["real_time_factor"])
    return [row("surge run in mock: wall time of a second of the vehicle", 1e6 / factor, "real time", 1e6)]
