"""A mock vehicle with its whole stack, and an operator who holds a depth: what soak, faults and benchmarks fly."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from hindrax_bag.run_folder import make_run_folder
from hindrax_bringup.liveness import processes_of
from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.processes import ONBOARD, RECORDER
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions, adopted, environment_beside
from hindrax_bringup.stack_lock import runtime_folder
from hindrax_bringup.stack_process import StackProcess, UpOptions
from hindrax_bringup.supervisor import RESTARTS_AT_MOST
from hindrax_core.errors import HindraxError

if TYPE_CHECKING:
    from hindrax_operator.nodes.operator_node import Operator

UP_S, DEPTH_m = 60.0, 0.8


@contextlib.contextmanager
def mock_stack(
    folder: Path,
    mock: MockOptions,
    *,
    record: bool = True,
    settings: tuple[str, ...] = (),
    restarts: int = RESTARTS_AT_MOST,
) -> Iterator[StackProcess]:
    """A stack whose run is `folder/run`; meanwhile this process has the settings of its graph.

    `restarts`: deaths in a row after which a process stays down.
    """
    run, tuning = make_run_folder(str(folder / "run"), default_vehicle()), ParameterOverrides(settings=settings)
    up = UpOptions(run.vehicle, mock, record, str(run.path), tuning=tuning, client="mock flight", restarts=restarts)
    with StackProcess(up) as stack, adopted(environment_beside(stack.entry)):
        yield stack


@contextlib.contextmanager
def holding_depth(stack: StackProcess) -> Iterator[Operator]:
    """The operator of a stack, armed, who holds a depth; HindraxError when a process dies."""
    from hindrax_operator.nodes.operator_node import Operator  # noqa: PLC0415  # rclpy reads the environment
    from hindrax_operator.nodes.orders import hold  # noqa: PLC0415  # the same

    def require_all() -> None:
        if deaths := stack.check():
            raise HindraxError(f"{'; '.join(deaths)}; {stack.folder.path}")

    with Operator(mock=True, tick=require_all) as operator:
        operator.wait(lambda: operator.navigation is not None, UP_S, lambda: "navigation")
        operator.wait(lambda: operator.thrusters is not None, UP_S, lambda: "the thrusters")
        operator.arm(seconds=UP_S)
        hold(operator, ["depth"], DEPTH_m, engaged=True)
        yield operator


def node_processes(stack: StackProcess) -> dict[str, int]:
    """Processes of a stack by name, without the mock and what is below the dead man."""
    found = processes_of(runtime_folder(), stack.pid)
    return {process.name: found[process.name] for process in (RECORDER, *ONBOARD) if process.name in found}
