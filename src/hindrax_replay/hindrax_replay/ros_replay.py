"""`replay --ros`: the real processes on recorded wires; their new bag is compared with the recorded one.

Sensors, control, identifier and recorder run as on the vehicle. Which sample falls into which cycle, and when a node
was up, differs from day to day: so a message is compared with the recorded one of equal values (devices) or the nearest
in time (computed from them), with the tolerances of the section `ros`.
"""

import contextlib
import shutil
import tempfile
import time
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from hindrax_bag.message_comparison import ComparisonReport, Rule, Rules, flat
from hindrax_bag.read.bag_reader import VEHICLE_FILE, attached_vehicle, attachments, messages
from hindrax_bag.read.survey import survey
from hindrax_bag.run_folder import RunFolder, write_parameters
from hindrax_bringup.node_options import wire_parameters
from hindrax_bringup.processes import CONTROL, IDENTIFIER, PILOT_STATUS_ASIDE, RECORDER, REPLAY, SENSORS
from hindrax_bringup.stack import environment, first_line, own_domain
from hindrax_bringup.supervisor import SupervisedProcess, Supervisor, last_words
from hindrax_core.errors import HindraxError
from hindrax_core.events import NS_PER_S
from hindrax_core.text.text_file import nothing_left, require_place, writing
from hindrax_core.topics import ALLOCATION, ESTIMATE, NAVIGATION, resolved
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_replay.bag_replay import Replayed
from hindrax_replay.recorded_devices import parameters_of
from hindrax_replay.wire_stage import compared

READY_S = 20.0
PATIENCE_S = 60.0
"""Wall time for all processes to start."""
SLOWEST = 20.0
"""Wall seconds per recorded second; slower is a fault, not a slow machine."""
OF_THE_RUN = {"vehicle", "use_sim_time", "port", "clock", "bag", "notes"}
"""Parameters of the place of that run; all others are tuning."""
SAME_NS = NS_PER_S // 2
"""Largest distance of two messages of a device with the same values."""
NEAR_NS = NS_PER_S // 40
"""Largest distance of two computed messages that are compared: half a tick, and its rounding."""
SETTLING_NS = 3 * NS_PER_S
"""At the start nodes discover their devices and each other at different times."""
ALLOCATION_NAME = resolved(ALLOCATION)
COMPUTED = {resolved(topic) for topic in (NAVIGATION, ALLOCATION, ESTIMATE)}
STAMP = ("header.stamp.sec", "header.stamp.nanosec")
Row = tuple[int, dict[str, object]]
"""Stamp [ns] and values by name; the stamp is also among them, as `stamp_s`."""


def replay_ros(bag: Path, rules: Rules, vehicle_file: str | None = None, out: Path | None = None) -> Replayed:
    """Run the processes over a bag and compare.

    Parameters
    ----------
    bag, rules
        Folder, and tolerances.
    vehicle_file
        None: the one in the bag. UsageError when neither is there, or the bag holds no wire frames.
    out
        Folder of that run, which is kept; None: it is not.

    Returns
    -------
    Replayed
        Counts, differences and times. HindraxError when a process ends on the way.
    """
    begin = time.perf_counter()
    found = survey(bag)
    done = Replayed(bag, ComparisonReport(rules), found.first, found.seconds)
    with _folder(out) as folder:
        _run(bag, folder, vehicle_file, done.vehicle_s)
        compare_bags(bag, folder.bag, done.ledger, load_vehicle(folder.vehicle))
    done.wall_s = time.perf_counter() - begin
    return done


@contextlib.contextmanager
def _folder(out: Path | None) -> Iterator[RunFolder]:
    if out is None:
        with tempfile.TemporaryDirectory(prefix="hindrax-replay-", ignore_cleanup_errors=True) as place:
            yield RunFolder(Path(place))
        return
    folder = RunFolder(out.resolve())
    with nothing_left(folder.path):
        with writing(out, "name another folder with --out"):
            out.mkdir(parents=True, exist_ok=True)
        require_place(folder.vehicle)
        yield folder


def _run(bag: Path, folder: RunFolder, vehicle_file: str | None, seconds: float) -> None:
    inside = attachments(bag)
    if vehicle_file:
        shutil.copyfile(vehicle_file, folder.vehicle)
    else:
        attached_vehicle(bag, inside)
        folder.vehicle.write_bytes(inside[VEHICLE_FILE])
    tuned = parameters_of(inside)
    with own_domain(mock=True) as domain, Supervisor(folder.logs, environment(mock=True, domain=domain)) as supervisor:
        words = ["--bag", str(bag.resolve()), "--vehicle", str(folder.vehicle)]
        wires = supervisor.start(REPLAY, words, pipe=True)
        facts = first_line(wires, READY_S, folder.logs / "replay.log")
        arguments = write_parameters(folder.parameters, _parameters(folder, tuned, wire_parameters(facts)))
        for process in (RECORDER, SENSORS, CONTROL, IDENTIFIER):
            supervisor.start(process, [*arguments, *(PILOT_STATUS_ASIDE if process is CONTROL else ())])
        _wait(wires, supervisor, folder, READY_S + PATIENCE_S + SLOWEST * seconds)
        supervisor.stop("recorder")


def _parameters(
    folder: RunFolder, tuned: dict[str, dict[str, object]], ports: dict[str, dict[str, object]]
) -> dict[str, dict[str, object]]:
    """Parameters of the recorded run, at the ports of this one."""
    made: dict[str, dict[str, object]] = {
        f"/**/{node}": {name: value for name, value in block.items() if name not in OF_THE_RUN}
        for node, block in tuned.items()
        if node != "**"
    }
    for node, block in ports.items():
        made.setdefault(node, {}).update(block)
    made.setdefault("/**/recorder", {}).update({"bag": str(folder.bag), "notes": "replay in mock"})
    made["/**"] = {"vehicle": str(folder.vehicle), "use_sim_time": True}
    return {node: block for node, block in made.items() if block}


def _wait(wires: SupervisedProcess, supervisor: Supervisor, folder: RunFolder, seconds: float) -> None:
    """Until the record is at its end; HindraxError when it does not come there or a process is down for good."""
    deadline = time.monotonic() + seconds
    while wires.handle.poll() is None:
        if time.monotonic() > deadline:
            raise HindraxError(f"the replay has not ended within {seconds:.0f} s; read {folder.logs}")
        time.sleep(0.2)
        supervisor.check()
        # The record may have come to its end since it was asked above: that is no process that is missing.
        supervisor.require(wires.process.name)
    if wires.handle.returncode:
        raise HindraxError(f"the replayed wires ended; {last_words(folder.logs / 'replay.log')}")


# ---- two bags of the same run


def compare_bags(recorded: Path, replayed: Path, ledger: ComparisonReport, vehicle: Vehicle) -> None:
    """Compare the messages of devices, navigator, allocator and identifier in the span that both bags cover.

    Parameters
    ----------
    recorded, replayed
        Folders.
    ledger
        Gets what differs.
    vehicle
        Of both.
    """
    devices = compared(vehicle)
    there, here = (_rows(bag, devices | COMPUTED) for bag in (recorded, replayed))
    for topic in sorted(there):
        if topic in here:
            rule = ledger.rules.of(topic)
            by_values = (topic in devices and not rule.sampled) or topic == ALLOCATION_NAME
            _compare(topic, rule, there[topic], here[topic], ledger, by_values=by_values)
        else:
            ledger.unmatched(topic, there[topic][0][0], "recorded, not replayed", "messages", "none at all")


def _rows(bag: Path, topics: frozenset[str]) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = defaultdict(list)
    for message in messages(bag, topics):
        values = dict(flat(message.decoded()))
        seconds, nanoseconds = (values.pop(name) for name in STAMP)
        stamp = seconds * NS_PER_S + nanoseconds
        values["stamp_s"] = stamp / NS_PER_S
        found[message.topic].append((stamp, values))
    return found


def _compare(
    topic: str, rule: Rule, there: list[Row], here: list[Row], ledger: ComparisonReport, *, by_values: bool
) -> None:
    """Compare messages of devices with those of equal exact fields, all others with the nearest in time.

    Equal fields: the same bytes came through, a little sooner or later.
    """
    exact = [name for name in there[0][1] if by_values and rule.is_sharp(name)]

    def key(values: dict[str, object]) -> tuple[str, ...]:
        return tuple(repr(values.get(name)) for name in exact)

    candidates: dict[tuple[str, ...], list[Row]] = defaultdict(list)
    for row in here:
        candidates[key(row[1])].append(row)
    for stamp, values in there:
        if not here[0][0] + SETTLING_NS <= stamp <= here[-1][0] - SAME_NS:
            continue
        same = candidates[key(values)]
        at = bisect_left(same, stamp, key=lambda row: row[0])
        nearest = min(same[max(0, at - 1) : at + 1], key=lambda row: abs(row[0] - stamp), default=None)
        if nearest is None or abs(nearest[0] - stamp) > (SAME_NS if by_values else NEAR_NS):
            shown = [f"{name}={values[name]}" for name in exact if isinstance(values[name], float)]
            ledger.unmatched(topic, stamp, "recorded, not replayed", ", ".join(shown[:3]) or "a message", "none")
            continue
        ledger.compare_values(topic, stamp, values, nearest[1])
        if by_values:
            same.remove(nearest)
