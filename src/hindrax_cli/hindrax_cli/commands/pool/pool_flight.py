"""`hindrax pool-test`: the main job, from arming to a report."""

import argparse
import math
from collections.abc import Mapping
from pathlib import Path

from hindrax_bringup.stack import FAULT_HELP, SIMULATOR_HELP, WORLD_HELP, MockOptions, world_of_pool_test
from hindrax_cli.argument_types import (
    add_json,
    add_tuning,
    add_uncommissioned,
    add_vehicle,
    at_least,
    pace,
    positive,
    seed,
    share,
    tuning_of,
)
from hindrax_cli.autopilot_vehicle import HELP as AUTOPILOT_HELP
from hindrax_cli.autopilot_vehicle import ask_autopilot, behind_autopilot, require_address
from hindrax_cli.command import command, option
from hindrax_cli.commands.operate.manual_control import PLACE_HELP, place_of
from hindrax_cli.commands.operate.up_stop import require_known
from hindrax_cli.interrupt import hung_up_alike
from hindrax_control.maneuver.goal import EXCITATIONS, PLATEAUS
from hindrax_control.pool_bounds import PoolBounds
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.vehicle import AXES, Vehicle, load_vehicle
from hindrax_ident.online.aim import Aim
from hindrax_operator.pool_run import ABORT, CONTINUE, PoolOptions, run_pool_test

SESSION_HELP = (
    "guided session of a pool day: legs, weighing, repeats, one estimate over all; FOLDER of one that was "
    "interrupted goes on with it, any other gets the results; default runs/<time>"
)
ACTION_HELP = (
    "session: wait until a client of the ROS 2 action session/run begins it; it may answer and cancel, and what arms "
    "wants Enter here"
)
PLAN_HELP = "only rehearse it in lock-step: timetable, clearances, charge and uncertainty, without ROS and devices"


def aim_of(arguments: argparse.Namespace) -> Aim | None:
    """End of the requested experiment, None for the pilot's plan; UsageError with an excitation without legs."""
    if arguments.until is None and arguments.minutes is None:
        return None
    if arguments.excitation != PLATEAUS:
        found = f"--excitation {arguments.excitation}"
        raise UsageError(f"--until, --minutes: found {found}, wanted {PLATEAUS}, of which single legs can be chosen")
    return Aim(arguments.until, arguments.minutes)


def _mock(arguments: argparse.Namespace) -> MockOptions:
    """Options of the mock."""
    world = world_of_pool_test(arguments.world, arguments.simulator)
    return MockOptions(
        arguments.seed, arguments.rate or 0.0, tuple(arguments.fault), world, simulator=arguments.simulator
    )


def _use_autopilot(arguments: argparse.Namespace) -> tuple[str, ...]:
    """Fly a copy of the vehicle file, behind the autopilot; return the options that fly it again."""
    if arguments.mock:
        raise UsageError("--autopilot: found --mock too, wanted one: the mock has an autopilot of its own")
    file, address = Path(arguments.vehicle), arguments.autopilot
    require_address(address)
    measured = bool(load_vehicle(file).measuring("velocity"))
    asked = arguments.plan or ask_autopilot(file, address, lambda words: print_stderr(f"--autopilot: {words}"))
    aided = measured and asked
    copy, left_out = behind_autopilot(file, address, aided=aided)
    arguments.vehicle = str(copy)
    if left_out:
        print_stderr(f"--autopilot: without {', '.join(left_out)}, which are not on its line")
    if measured and not aided:
        print_stderr(
            "--autopilot: its estimator claims no velocity (it has none without a DVL or GPS and a compass), so no "
            "motion that needs one can be flown"
        )
    settings = [word for one in arguments.set or () for word in ("--set", str(one))]
    proof = ("--uncommissioned",) if arguments.uncommissioned else ()
    return ("--autopilot", address, "--vehicle", str(file), *proof, *settings)


def _session(arguments: argparse.Namespace) -> int:
    """Fly a guided session, begun here or by a client."""
    with hung_up_alike():
        if arguments.action:
            from hindrax_cli.commands.pool.session_by_action import guide_by_action  # noqa: PLC0415  # others serve nothing

            return guide_by_action(arguments)
        from hindrax_cli.commands.pool.guided_session import guide  # noqa: PLC0415  # a single flight needs none of it

        return guide(arguments)


def require_start(vehicle: Vehicle, start: tuple[float, float, float]) -> None:
    """UsageError for a start outside the pool, before anything starts."""
    x_m, y_m, heading_rad = start
    try:
        PoolBounds(vehicle, 0.0).require_inside(x_m, y_m, 0.0 if math.isnan(heading_rad) else heading_rad)
    except UsageError as error:
        raise UsageError(f"--start {error}") from error


@command(
    "./hindrax pool-test --plan --dof all\n"
    "./hindrax pool-test --mock --dof surge --seed 7\n"
    "./hindrax pool-test --mock --dof all --until 2% --minutes 5\n"
    "./hindrax pool-test --session --mock --dof surge sway heave yaw",
    option("--mock", action="store_true", help="fly the mock vehicle instead of the one on this machine"),
    option("--plan", action="store_true", help=PLAN_HELP),
    option("--session", nargs="?", const="", metavar="FOLDER", help=SESSION_HELP),
    option("--repeats", type=at_least(1), default=2, metavar="N", help="session: legs of every motion; default 2"),
    option(
        "--load", type=positive, metavar="N", help="session: force of the weight [N]; without it nothing is weighed"
    ),
    option("--lever", type=positive, metavar="M", help="session: distance between the two lines of yaw [m]"),
    option(
        "--yes", action="store_true", help="session: no questions; the tether counts as led away, nothing is weighed"
    ),
    option("--action", action="store_true", help=ACTION_HELP),
    option(
        "--dof",
        nargs="+",
        default=["surge"],
        choices=[*AXES, "all"],
        help="default: surge; all: every motion that its thrusters serve",
    ),
    option(
        "--until",
        type=share,
        metavar="SHARE",
        help="noise of the drag at which it ends, such as 2%%: the identification chooses the legs",
    ),
    option("--minutes", type=positive, help="time limit, after which it ends with the result so far"),
    option("--seed", type=seed, default=1, help="of the mock's noise and of the excitation; default 1"),
    option("--rate", type=pace, help="mock: times real time at most; default, and 0: as fast as the computer keeps up"),
    option("--fault", action="append", default=[], metavar="NAME", help=FAULT_HELP),
    option("--world", help=f"{WORLD_HELP}. Default: pool; with --simulator: ideal"),
    option("--simulator", default="", metavar="KIND", help=SIMULATOR_HELP),
    option("--excitation", default=PLATEAUS, choices=(PLATEAUS, *EXCITATIONS), help="default: plateaus"),
    option(
        "--on-cancel",
        choices=("neutral", "hold"),
        default="neutral",
        help="how a guard ends it, before it is disarmed; default: neutral",
    ),
    option(
        "--without-record",
        choices=(ABORT, CONTINUE),
        default=ABORT,
        help="reaction when the recorder or its disk fails in flight; default: abort",
    ),
    option("--start", nargs="+", metavar="X", help=f"X Y [DEG]: {PLACE_HELP}"),
    option("--out", metavar="DIR", help="new or empty folder for the results; default runs/<time>"),
    add_vehicle,
    option("--autopilot", metavar="ADDRESS", help=AUTOPILOT_HELP),
    add_tuning,
    add_uncommissioned,
    option("--headless", action="store_true", help="no live progress, one line per phase"),
    add_json,
)
def pool_test(arguments: argparse.Namespace) -> int:
    """Fly the maneuvers and identify the vehicle: the main job."""
    again = () if arguments.autopilot is None else _use_autopilot(arguments)
    aim = aim_of(arguments)
    if arguments.session is not None:
        return _session(arguments)
    of_session = [f"--{one}" for one in ("load", "lever", "yes", "action") if getattr(arguments, one)]
    if of_session:
        raise UsageError(f"found {', '.join(of_session)} without --session, wanted both or neither")
    if arguments.plan:
        from hindrax_cli.pool_plan import rehearse_and_show  # noqa: PLC0415  # a flight needs neither SciPy nor the simulator

        return rehearse_and_show(arguments, aim)
    of_mock = arguments.fault or arguments.world is not None or arguments.rate is not None or arguments.simulator
    if not arguments.mock and of_mock:
        raise UsageError("--fault, --world, --rate and --simulator are for --mock only")
    if not arguments.mock:
        from hindrax_cli.health_checks.wires import require_ports  # noqa: PLC0415  # every driver: a mock starts without them

        require_ports(load_vehicle(Path(arguments.vehicle)), arguments.vehicle)
    mock = _mock(arguments) if arguments.mock else None
    vehicle, tuning, start = (
        load_vehicle(arguments.vehicle),
        tuning_of(arguments),
        place_of(arguments.start or [], "--start"),
    )
    if mock is not None:
        require_known(mock, vehicle)
    if arguments.start:
        require_start(vehicle, start)
    predicted: Mapping[str, float] = {}
    if aim is not None:
        from hindrax_cli.pool_plan import predicted_of  # noqa: PLC0415  # as above

        predicted = predicted_of(arguments, aim)
    options = PoolOptions(
        motions=tuple(arguments.dof),
        vehicle_file=Path(arguments.vehicle),
        mock=mock,
        out=arguments.out,
        seed=arguments.seed,
        excitation=arguments.excitation,
        on_cancel=arguments.on_cancel,
        without_record=arguments.without_record,
        headless=arguments.headless or arguments.json,
        json=arguments.json,
        aim=aim,
        predicted=predicted,
        tuning=tuning,
        uncommissioned=arguments.uncommissioned,
        start=start if arguments.start else None,
        again=again,
    )
    with hung_up_alike():
        return run_pool_test(options)
