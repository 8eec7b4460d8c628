"""One thruster alone, at the bench: to see which one it is, that it turns, and which way it pulls.

Only one master may command thrusters. With the control process up, it is that master, fifty times a second and also
with nothing to do; so a thruster alone is run either over a thrusters process without another commander, or over one
that is started for it and ended after it. It is armed for the run and disarmed at its end, whatever ends it.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.processes import THRUSTERS
from hindrax_bringup.ros_graph import DOMAIN
from hindrax_bringup.stack import MockOptions
from hindrax_bringup.stack_lock import choose, require_meant, stacks
from hindrax_bringup.stack_process import StackProcess, UpOptions
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_operator.connection import joined
from hindrax_operator.snapshot import node_problems

if TYPE_CHECKING:
    from hindrax_operator.nodes.operator_node import Operator

UP_S = 30.0
LOOK_S = 2.0
ARMING_S = 60.0


def run_one(
    thruster: str, force_N: float, seconds: float, vehicle_file: Path, *, mock: bool, pid: int | None = None
) -> str:
    """Arm, run one thruster for some seconds, disarm.

    Parameters
    ----------
    thruster
        Name in the vehicle file, or number from 1.
    force_N : [N]
        Along its x axis.
    seconds : [s]
        Of the vehicle's time.
    vehicle_file
        Whose curve gives the pulse.
    mock
        Whether it is one of a mock, which is started where none is up; else of the stack here, or on the graph.
    pid
        Process of the stack it belongs to; None: the only one of this kind.

    Returns
    -------
    str
        One sentence: applied pulses of this thruster and of the others.
    """
    vehicle = load_vehicle(vehicle_file)
    vehicle.output_channels()
    index, pulses = pulses_of(vehicle, thruster, force_N)
    name = vehicle.thrusters[index].name
    with _thrusters(vehicle_file, mock=mock, pid=pid) as operator:
        from hindrax_operator.nodes.orders import require_sole, run_alone  # noqa: PLC0415  # rclpy reads the environment

        require_sole(operator)
        operator.wait_for_thrusters()
        print_stderr(f"arming; {name} will turn, keep clear")
        try:
            operator.arm(seconds=ARMING_S)
            print_stderr(f"{name}: {force_N:+.1f} N, {pulses[index]:.0f} us, for {seconds:g} s; Ctrl-C ends it")
            applied = list(run_alone(operator, pulses, seconds).pulses)
        finally:
            with contextlib.suppress(HindraxError):
                operator.arm(arm=False)
    others = [pulse for at, pulse in enumerate(applied) if at != index]
    rest = f"the others between {min(others):.0f} and {max(others):.0f} us" if others else "it is the only one"
    return f"{name} ran at {applied[index]:.0f} us, {rest}; disarmed"


def pulses_of(vehicle: Vehicle, thruster: str, force_N: float) -> tuple[int, list[float]]:
    """Return the pulses with which one thruster gives a force and the others rest.

    Parameters
    ----------
    vehicle
        With the curves of all thrusters.
    thruster
        Name in the vehicle file, or number from 1.
    force_N : [N]
        Along its x axis.

    Returns
    -------
    tuple[int, list[float]]
        Index of the thruster, and the pulse of each [us].

    Raises
    ------
    UsageError
        Where there is no such thruster, or its curve does not reach this force, or has it in the dead band.
    """
    names = [one.name for one in vehicle.thrusters]
    index = names.index(thruster) if thruster in names else _numbered(thruster, names)
    curves = thrust_curves(vehicle)
    curve = curves[index]
    low, high = curve.range_N
    if not low <= force_N <= high:
        inside = f"{low + 0.05:.1f} to {high - 0.05:.1f} N"  # rounded inwards: what is wanted is taken
        raise UsageError(f"thruster {names[index]}: found {force_N:g} N, wanted {inside}")
    pulses = [one.stop_us for one in curves]
    pulses[index] = curve.pulse(force_N)
    if force_N and pulses[index] == curve.stop_us:
        back, forth = curve.gap_N
        least = f"{back:.2f} or {forth:+.2f} N at least"
        raise UsageError(f"thruster {names[index]}: {force_N:g} N is less than it can give, {least}")
    return index, pulses


def _numbered(text: str, names: list[str]) -> int:
    if text.isdigit() and 1 <= int(text) <= len(names):
        return int(text) - 1
    raise UsageError(f"thruster {text}: not of this vehicle; it has {', '.join(names)}, or 1 to {len(names)}")


@contextlib.contextmanager
def _thrusters(vehicle_file: Path, *, mock: bool, pid: int | None) -> Iterator[Operator]:
    """Yield an operator beside a thrusters process: one that runs already, or one of our own."""
    found = stacks()
    running = choose(found if pid is not None else [one for one in found if one.mock is mock], pid)
    if running is not None:
        if pid is None:
            require_meant(running, os.environ)
        print_stderr(f"vehicle: {running.whole_title}")
        with joined(running) as operator:
            yield operator
        return
    if not mock:
        # A stack that was started by a service or by `ros2 launch` announces nothing here; its topics show it.
        what = "only a mock vehicle, whose thrusters run with --mock," if found else "no stack"
        domain = os.environ.get(DOMAIN) or "0"
        where = f"the ROS graph of this terminal, domain {domain}"
        print_stderr(f"{what} is announced here; looking for thrusters in {where}")
        with joined(None) as operator:
            operator.pause(LOOK_S)
            if operator.thrusters is not None:
                yield operator
                return
        output = load_vehicle(vehicle_file).output
        if output.device != "ros2_control":  # its port is a topic
            require_port(output.port)
    with _own_thrusters(vehicle_file, mock=mock) as operator:
        yield operator


def require_port(port: str) -> None:
    """HindraxError when the port of the output does not exist: there is no use in waiting for it."""
    if port.startswith("/") and not Path(port).exists():
        raise HindraxError(
            f"found no thrusters on the graph and no {port} on this machine; check cable and power (`./hindrax doctor` "
            "has the remedy), join the vehicle over its tether, or run one without a vehicle: --mock"
        )


@contextlib.contextmanager
def _own_thrusters(vehicle_file: Path, *, mock: bool) -> Iterator[Operator]:
    with tempfile.TemporaryDirectory(prefix="hindrax-") as place:
        folder = RunFolder(Path(place))
        shutil.copyfile(vehicle_file, folder.vehicle)
        hardware = MockOptions(rate=1.0) if mock else None
        up = UpOptions(folder.vehicle, hardware, out=place, client="thruster", processes=(THRUSTERS.name,))
        with StackProcess(up) as stack:
            print_stderr(f"vehicle: {stack.entry.whole_title}; only its thrusters, started for this")

            def look_after() -> None:
                for sentence in stack.check():
                    print_stderr(sentence)

            with joined(stack.entry, tick=look_after) as operator:
                operator.wait(lambda: operator.thrusters is not None, UP_S, lambda: _missing(operator))
                yield operator


def _missing(operator: Operator) -> str:
    """The thrusters, and the reason of their silence, from /diagnostics."""
    silent = "their process sends nothing, `./hindrax doctor` checks the ports"
    return f"the thrusters; {'; '.join(node_problems(operator)) or silent}"
