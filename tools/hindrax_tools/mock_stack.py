"""A mock vehicle with its whole stack, and an operator who holds a depth: what soak, faults and benchmarks fly."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from hindrax_bag.run_folder import make_run_folder
from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.processes import modules
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions, Stack, adopted, environment, own_domain
from hindrax_bringup.supervisor import Supervisor

if TYPE_CHECKING:
    from hindrax_operator.nodes.operator_node import Operator

UP_S, DEPTH_m = 60.0, 0.8


@contextlib.contextmanager
def mock_stack(
    folder: Path, mock: MockOptions, *, record: bool = True, settings: tuple[str, ...] = ()
) -> Iterator[Stack]:
    """A stack whose run is `folder/run`; meanwhile this process has the settings of its graph."""
    run = make_run_folder(str(folder / "run"), default_vehicle())
    with own_domain(mock=True) as domain:
        made = environment(mock=True, domain=domain)
        with Supervisor(run.logs, made, preload=modules(mock=True)) as supervisor, adopted(made):
            stack = Stack(run, supervisor, tuning=ParameterOverrides(settings=settings))
            stack.start(mock, record=record)
            yield stack


@contextlib.contextmanager
def holding_depth(stack: Stack) -> Iterator[Operator]:
    """The operator of a stack, armed, who holds a depth and supervises the processes."""
    from hindrax_operator.nodes.operator_node import Operator  # noqa: PLC0415  # rclpy reads the environment
    from hindrax_operator.nodes.orders import hold  # noqa: PLC0415  # the same

    with Operator(mock=True, tick=stack.supervisor.check) as operator:
        operator.wait(lambda: operator.navigation is not None, UP_S, lambda: "navigation")
        operator.wait(lambda: operator.thrusters is not None, UP_S, lambda: "the thrusters")
        operator.arm(seconds=UP_S)
        hold(operator, ["depth"], DEPTH_m, engaged=True)
        yield operator
