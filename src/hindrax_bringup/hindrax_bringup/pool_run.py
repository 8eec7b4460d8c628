"""One pool test: start, arm, fly, disarm, identify, report."""

from __future__ import annotations

import contextlib
import json
import signal
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hindrax_bag.limits import Limits
from hindrax_bringup.identification import Identified, identify_run, show
from hindrax_bringup.presence import announced
from hindrax_bringup.progress import Progress
from hindrax_bringup.run_folder import RunFolder, make_run_folder
from hindrax_bringup.stack import MockOptions, Stack, adopted, environment, own_domain, presence_of
from hindrax_bringup.supervisor import Supervisor
from hindrax_bringup.tether import at_hand
from hindrax_core.errors import HindraxError
from hindrax_core.vehicle import Vehicle, load_vehicle

UP_S = 30.0
FLY_S = 3600.0
ARMING_S = 60.0
MOTION_S = 240.0
"""What a motion takes at most, for the check of free space: a staircase of plateaus takes two minutes."""


@dataclass(frozen=True, slots=True)
class PoolOptions:
    """What is flown, with which vehicle, and where the results go."""

    motions: tuple[str, ...]
    vehicle_file: Path
    mock: MockOptions | None
    out: str | None
    seed: int
    excitation: str
    on_cancel: str
    headless: bool
    json: bool


@dataclass(slots=True)
class Flight:
    """What a flight left besides the bag."""

    aborted: str = ""
    ailments: list[str] = field(default_factory=list)
    """What /diagnostics complained of when it ended."""
    vehicle_s: float = 0.0
    wall_s: float = 0.0
    facts: Mapping[str, Any] = field(default_factory=dict)

    @property
    def real_time_factor(self) -> float:
        """Vehicle time over wall time, from arming to disarming."""
        return self.vehicle_s / self.wall_s if self.wall_s > 0.0 else 0.0


def run_pool_test(options: PoolOptions) -> int:
    """Fly, identify, print; 0 when all was flown and identified."""
    vehicle = load_vehicle(options.vehicle_file)
    folder = make_run_folder(options.out, options.vehicle_file)
    Limits(planned_s=MOTION_S * len(options.motions)).check_space(folder.path)
    with Progress(headless=options.headless) as progress:
        flight = fly(options, vehicle, folder, progress)
        progress.say("identifying over the bag")
        identified = identify_run(folder, vehicle, mock=options.mock is not None)
    document = identified.document(folder, round(flight.real_time_factor, 2), flight.aborted or None)
    document |= {"mock": flight.facts} if options.mock else {}
    if options.json:
        print(json.dumps(document))
    else:
        finish(identified, folder, flight)
    return 1 if flight.aborted or not identified.complete else 0


def finish(identified: Identified, folder: RunFolder, flight: Flight) -> None:
    """Print what a person wants to know at the end."""
    if identified.results.motions:
        show(identified)
    if flight.aborted:
        print(f"aborted by {flight.aborted}", file=sys.stderr)
        for line in flight.ailments:
            print(f"  {line}", file=sys.stderr)
    if flight.facts.get("wall_hits"):
        print(f"the mock vehicle ran into a wall of its pool (contacts: {flight.facts['wall_hits']})", file=sys.stderr)
    print(f"flown at {flight.real_time_factor:.1f} times real time ({flight.vehicle_s:.0f} s of vehicle time)")
    for path in (folder.report, folder.coefficients, folder.bag):
        print(f"  {path}")


def fly(options: PoolOptions, vehicle: Vehicle, folder: RunFolder, progress: Progress) -> Flight:
    """Start the stack, fly the motions, end the stack; the bag is closed and readable when this returns."""
    mock = options.mock
    flight = Flight()
    notes = f"pool-test {' '.join(options.motions)}{' in mock' if mock else ''}"
    with own_domain(mock=mock is not None) as domain:
        made = environment(mock=mock is not None, domain=domain, tether=None if mock else at_hand(progress.say))
        with Supervisor(folder.logs, made) as supervisor:
            stack = Stack(folder, vehicle, supervisor, notes)
            progress.say(f"starting {'the mock vehicle and ' if mock else ''}the stack")
            stack.start(mock, record=True)
            with announced(presence_of(stack, made)), adopted(made):
                _operate(options, flight, supervisor, progress)
            supervisor.stop("recorder")
            flight.facts = stack.last_facts()
    return flight


def _operate(options: PoolOptions, flight: Flight, supervisor: Supervisor, progress: Progress) -> None:
    from hindrax_bringup.nodes.operator import Operator  # noqa: PLC0415  # rclpy reads the environment as it is imported

    deaths: list[str] = []

    def tick() -> None:
        for said in supervisor.check():
            progress.say(said)
            deaths.append(said)
        supervisor.require()
        progress.show(operator.maneuver, operator.navigation, operator.estimates)

    with Operator(mock=options.mock is not None, tick=tick) as operator:
        operator.wait(lambda: operator.navigation is not None, UP_S, lambda: missing(operator))
        operator.wait(lambda: operator.thrusters is not None, UP_S, lambda: "the thrusters to say anything")
        progress.say("sensors and thrusters are up; arming")
        with deferred_interrupt(), disarmed_at_the_end(operator):
            operator.arm(seconds=ARMING_S)
            begin, wall = operator.now(), time.monotonic()
            progress.say(f"armed; flying {', '.join(options.motions)}")
            try:
                flight.aborted = operator.fly(
                    list(options.motions),
                    excitation=options.excitation,
                    seed=options.seed,
                    on_cancel=options.on_cancel,
                    seconds=FLY_S,
                )
            except KeyboardInterrupt:
                flight.aborted = "operator: stopped by Ctrl-C"
            except HindraxError as error:
                # What was flown until then is in the bag, and worth to be identified.
                flight.aborted = f"stack: {error}"
            else:
                flight.aborted += f"; meanwhile {deaths[-1]}" if flight.aborted and deaths else ""
            flight.ailments = ailments(operator) if flight.aborted else []
            flight.wall_s = time.monotonic() - wall
            flight.vehicle_s = (operator.now() - begin) / 1e9
        progress.say("disarmed")


@contextlib.contextmanager
def disarmed_at_the_end(operator: Any) -> Iterator[None]:
    """Disarm whatever happens; a failure to do so must not hide what went wrong before (the silence does it then)."""
    try:
        yield
    finally:
        with contextlib.suppress(HindraxError):
            operator.cancel()
        with contextlib.suppress(HindraxError):
            operator.arm(arm=False, seconds=5.0)


@contextlib.contextmanager
def deferred_interrupt() -> Iterator[None]:
    """The first Ctrl-C interrupts the flight; further ones do not interrupt the landing."""
    count = 0

    def interrupt(number: int, frame: Any) -> None:
        nonlocal count
        count += 1
        if count == 1:
            signal.default_int_handler(number, frame)

    before: dict[int, Any] = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def missing(operator: Any) -> str:
    """What is not there yet, from /diagnostics."""
    return "a navigation solution\n  " + ("\n  ".join(ailments(operator)) or "no node has reported anything")


def ailments(operator: Any) -> list[str]:
    """Every complaint of /diagnostics, as `node: what is wrong`."""
    found = operator.diagnostics.items()
    return [f"{name.removeprefix('hindrax: ')}: {one.message}" for name, one in found if one.level != b"\x00"]
