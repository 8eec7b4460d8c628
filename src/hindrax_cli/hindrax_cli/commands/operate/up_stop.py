"""`hindrax up` and `stop`: start a stack, and stop it in any state."""

import argparse
import math
import time
from collections.abc import Mapping
from pathlib import Path

from hindrax_bringup.liveness import PERIOD_S, beats
from hindrax_bringup.network.tether import add_tether, tether_setting
from hindrax_bringup.processes import THRUSTERS
from hindrax_bringup.stack import FAULT_HELP, SIMULATOR_HELP, WORLD_HELP, MockOptions
from hindrax_bringup.stack_lock import StackLock, runtime_folder, stacks, vehicle_stack
from hindrax_bringup.stack_process import UpOptions, become
from hindrax_cli.argument_types import (
    add_parameters,
    add_tuning,
    add_uncommissioned,
    add_vehicle,
    output_settings,
    pace,
    positive,
    seed,
    tuning_of,
)
from hindrax_cli.command import command, option
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_drivers.nodes.deadman import write_neutral
from hindrax_operator.connection import add_stack, chosen_stack, find_stack
from hindrax_operator.stopping import OutputStop, stop_lost_outputs, stop_outputs, stop_over_ros


def add_mock_options(parser: argparse.ArgumentParser, rate: str = "1") -> None:
    """Behavior of the mock vehicle; `rate`: default of the command."""
    parser.add_argument("--seed", type=seed, help="mock: seed of its noise; default 1")
    parser.add_argument("--rate", type=pace, help=f"mock: times real time at most (0: no bound); default {rate}")
    parser.add_argument("--fault", action="append", default=[], metavar="NAME", help=FAULT_HELP)
    parser.add_argument("--world", help=f"{WORLD_HELP}. Default: ideal")
    parser.add_argument("--simulator", default="", metavar="KIND", help=SIMULATOR_HELP)


def mock_options(arguments: argparse.Namespace) -> MockOptions:
    """Options of the mock; default pace for an operator: real time."""
    rate = 1.0 if arguments.rate is None else arguments.rate
    seed_of_all = 1 if arguments.seed is None else arguments.seed
    world = "ideal" if arguments.world is None else arguments.world
    made = MockOptions(seed_of_all, rate, tuple(arguments.fault), world, simulator=arguments.simulator)
    require_known(made, load_vehicle(arguments.vehicle))
    return made


def require_known(options: MockOptions, vehicle: Vehicle) -> None:
    """UsageError for a world, a fault, a simulator or a truth that there is not, before anything starts."""
    from hindrax_sim.conditions.world_table import sizes_of  # noqa: PLC0415  # no simulator on the vehicle
    from hindrax_sim.physics.plant import truth_of  # noqa: PLC0415  # as above

    sizes_of(options.world, options.seed)
    if options.simulator:
        from hindrax_sim.simulators import simulator_of  # noqa: PLC0415  # as above

        simulator_of(options.simulator, vehicle.name)
        if options.world != "ideal":
            raise UsageError(f"--world {options.world}: the simulator has its own water; leave it out, or say ideal")
    else:
        truth_of(vehicle)
    if options.faults:
        from hindrax_sim.faults.fault_registry import parse_fault  # noqa: PLC0415  # as above; takes 0.2 s

        for fault in options.faults:
            parse_fault(fault, vehicle)


@command(
    "./hindrax up --mock --record",
    option("--mock", action="store_true", help="the mock vehicle instead of the one on this machine"),
    option("--record", action="store_true", help="write a bag"),
    add_vehicle,
    option("--out", metavar="DIR", help="new or empty folder for logs and bag; default runs/<time>"),
    option(
        "--keep", type=positive, metavar="GB", help="size limit of runs/: the oldest are removed; default: keep all"
    ),
    add_tether,
    option(
        "--without-operator",
        choices=("hold", "neutral"),
        default="hold",
        help="with a tether, when the operator is silent for 2 s: end the maneuver and hold (default), or disarm",
    ),
    add_mock_options,
    add_tuning,
    add_uncommissioned,
)
def up(arguments: argparse.Namespace) -> int:
    """Start the stack and keep it up until Ctrl-C; other terminals operate it."""
    of_mock = (arguments.world, arguments.rate, arguments.seed)
    given = arguments.fault or arguments.simulator or any(one is not None for one in of_mock)
    if given and not arguments.mock:
        raise UsageError("--fault, --world, --rate, --seed and --simulator are for --mock only")
    mock = mock_options(arguments) if arguments.mock else None
    # A mock is for this machine alone, unless it is asked for by name here.
    tether = tether_setting() if arguments.tether or not arguments.mock else None
    vehicle, without, tuning = Path(arguments.vehicle), arguments.without_operator, tuning_of(arguments)
    load_vehicle(vehicle).output_channels()
    keep_bytes = math.inf if arguments.keep is None else arguments.keep * 1e9
    become(UpOptions(vehicle, mock, arguments.record, arguments.out, tether, without, tuning, keep_bytes))


@command(
    "./hindrax stop",
    add_stack,
    option(
        "--output",
        action="store_true",
        help="after a stack was killed: put neutral on the thruster output of --vehicle, without any stack",
    ),
    add_vehicle,
    add_parameters,
)
def stop(arguments: argparse.Namespace) -> int:
    """Neutral, disarm and cancel the maneuver, in every stack on this machine; or write neutral without a stack."""
    if arguments.output:
        return neutral_on_output(arguments)
    # All of them by default, so that no number has to be looked up first. Every output before any ROS, which may be
    # slow, or not to be had from this terminal.
    found = stacks()
    wanted = [one for one in [chosen_stack(arguments)] if one] if arguments.stack is not None else found
    stopped = stop_outputs(wanted)
    lost = {} if arguments.stack is not None else stop_lost_outputs(found)
    for stack, output in zip(wanted, stopped, strict=True):
        if output.neutral:
            print_fitted(f"stopped and disarmed: {stack.whole_title}")
    failed = []
    for pid, output in lost.items():
        if output.neutral:
            print_fitted(f"stopped and disarmed: thrusters without a stack, dead man {pid}")
        failed += [f"dead man {pid}: {sentence}" for sentence in output.failures]
    for stack, output in zip(wanted, stopped, strict=True):
        failed += cancelled(stack, output, sim_time=arguments.sim_time)
    if not found:
        failed += stopped_elsewhere(arguments, lost)
    for sentence in failed:
        print_stderr(f"hindrax stop: {sentence}")
    return 1 if failed else 0


def cancelled(stack: StackLock, output: OutputStop, *, sim_time: bool) -> list[str]:
    """Cancel over ROS what a stack flies.

    Parameters
    ----------
    stack
        Whose graph is joined.
    output
        What was reached on its wire before.
    sim_time
        Whether the time comes by /clock.

    Returns
    -------
    list[str]
        What failed; nothing has where its output is neutral already.
    """
    wrong = stop_over_ros(stack, sim_time=sim_time)
    if not wrong:
        if not output.neutral:
            print_fitted(f"stopped and disarmed: {stack.whole_title}")
        return []
    if output.neutral:
        why = "; ".join(wrong)
        print_stderr(f"hindrax stop: {stack.title}: disarmed, but over ROS nothing could be cancelled ({why})")
        return []
    return [f"{stack.title}: {sentence}" for sentence in (*output.failures, *wrong, on_the_wire(stack))]


def stopped_elsewhere(arguments: argparse.Namespace, lost: Mapping[int, OutputStop]) -> list[str]:
    """Stop what is in the ROS graph of this terminal; returns what failed. Where outputs were found here, nobody is."""
    if not lost:
        find_stack(arguments)
    title = "the ROS graph of this terminal"
    wrong = stop_over_ros(None, sim_time=arguments.sim_time, namespace=arguments.namespace)
    if not wrong:
        print_fitted(f"stopped and disarmed: {title}")
        return []
    if lost and all(one.neutral for one in lost.values()):
        return []
    return [f"{title}: {sentence}" for sentence in (*wrong, on_the_wire(None))]


def neutral_on_output(arguments: argparse.Namespace) -> int:
    """Write neutral as the dead man would; UsageError while a stack has the output, HindraxError where that fails."""
    if (found := vehicle_stack()) is not None:
        raise UsageError(f"--output: {found.title} runs, and its dead man has the output; `./hindrax stop` stops it")
    settings = output_settings(arguments)
    if write_neutral(settings):
        raise HindraxError(f"{settings.port}: neutral could not be written; cut the power")
    return 0


def on_the_wire(stack: StackLock | None) -> str:
    """Return what is known of the pulses of a stack that did not obey."""
    found = {} if stack is None else beats(runtime_folder(), stack.pid, time.monotonic())
    if THRUSTERS.name not in found:
        return "whether its thrusters turn is unknown here; if they do, cut the power"
    if found[THRUSTERS.name] > 2.0 * PERIOD_S:
        return "its dead man sends no heartbeat, so its thrusters may keep their last pulses; cut the power"
    return "its dead man is alive: the thrusters are neutral 0.5 s after the last command; if they turn, cut the power"
