"""`hindrax up`: start the stack and keep it up."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from hindrax_bringup.network.tether import add_tether, tether_setting
from hindrax_bringup.stack import FAULT_HELP, WORLD_HELP, MockOptions
from hindrax_bringup.stack_runner import UpOptions, run_up
from hindrax_cli.argument_types import add_tuning, add_vehicle, pace, positive, seed, tuning_of
from hindrax_core.errors import UsageError

NAME = "up"
HELP = "start the stack and keep it up until Ctrl-C; other terminals operate it"
EXAMPLE = "./hindrax up --mock --record"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Vehicle or mock, and what is kept."""
    parser.add_argument("--mock", action="store_true", help="the mock vehicle instead of the one on this machine")
    parser.add_argument("--record", action="store_true", help="write a bag")
    add_vehicle(parser)
    parser.add_argument("--out", metavar="DIR", help="new or empty folder for logs and bag; default runs/<time>")
    parser.add_argument(
        "--keep",
        type=positive,
        metavar="GB",
        help="room for runs/: older ones are removed; default: all stay",
    )
    add_tether(parser)
    parser.add_argument(
        "--without-operator",
        choices=("hold", "neutral"),
        default="hold",
        help="with a tether, when the operator is silent for 2 s: end the maneuver and hold (default), or disarm",
    )
    add_mock_options(parser)
    add_tuning(parser)


def add_mock_options(parser: argparse.ArgumentParser) -> None:
    """How the mock vehicle behaves."""
    parser.add_argument("--seed", type=seed, help="mock: of its noise; default 1")
    parser.add_argument("--rate", type=pace, help="mock: times real time at most (0: no bound); default 1")
    parser.add_argument("--fault", action="append", default=[], metavar="NAME", help=FAULT_HELP)
    parser.add_argument("--world", default="", help=f"{WORLD_HELP}. Default: ideal")


def run(arguments: argparse.Namespace) -> int:
    """Check the arguments, then start."""
    of_mock = arguments.fault or arguments.world or arguments.rate is not None or arguments.seed is not None
    if of_mock and not arguments.mock:
        raise UsageError("--fault, --world, --rate and --seed are for --mock only")
    mock = mock_options(arguments) if arguments.mock else None
    # A mock is for this machine alone, unless it is asked for by name here.
    tether = tether_setting() if arguments.tether or not arguments.mock else None
    vehicle, without, tuning = Path(arguments.vehicle), arguments.without_operator, tuning_of(arguments)
    keep_bytes = math.inf if arguments.keep is None else arguments.keep * 1e9
    return run_up(UpOptions(vehicle, mock, arguments.record, arguments.out, tether, without, tuning, keep_bytes))


def mock_options(arguments: argparse.Namespace) -> MockOptions:
    """Options of the mock; default pace for an operator: real time."""
    rate = 1.0 if arguments.rate is None else arguments.rate
    seed_of_all = 1 if arguments.seed is None else arguments.seed
    return MockOptions(seed_of_all, rate, tuple(arguments.fault), arguments.world or "ideal")
