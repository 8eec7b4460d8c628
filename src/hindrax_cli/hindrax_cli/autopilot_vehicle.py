"""A vehicle file flown by an autopilot at an address: what it measures, and nothing that is not on its line."""

import atexit
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from hindrax_core.bus_operations import DeviceError
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import after
from hindrax_core.text.yaml_text import read_yaml
from hindrax_core.vehicle import OF_OUTPUT, load_vehicle

if TYPE_CHECKING:
    from hindrax_drivers.devices.ardupilot.link import Link

DEVICE, ESTIMATOR = "ardusub", "ardusub_ekf"
PATIENCE_S, TURN_S = 15.0, 0.05
ALIGNED_S, LOOK_S = 60.0, 2.0
"""Time from its start in which an estimator with a GPS or DVL has a velocity, and the look at one that is older."""
NAMES = ("autopilot", "estimator")
"""Of sensors that the file does not name; not every autopilot has a rangefinder."""
ADDRESSES = ("udpin:", "udpout:", "tcp:", "/dev/")
HELP = "fly an ArduSub there: udpin:0.0.0.0:14550, udpout:HOST:PORT, tcp:HOST:PORT or a port; only its own sensors"


def is_address(text: str) -> bool:
    """Whether a text is the address of an autopilot, and no file."""
    return text.startswith(ADDRESSES)


def require_address(address: str) -> None:
    """UsageError for what is no address of an autopilot."""
    if not is_address(address):
        wanted = "udpin:0.0.0.0:14550, udpout:192.168.2.2:14550, tcp:127.0.0.1:5760 or /dev/ttyACM0"
        raise UsageError(f"--autopilot: found {address!r}, wanted an address such as {wanted}")


def asked_parameters(address: str, wanted: Sequence[str]) -> dict[str, float]:
    """Ask an ArduSub for parameters by name; nothing is written, nothing moves.

    HindraxError where none answers, and without the drivers, as in the wheel; DeviceError where the address cannot be
    opened.

    Parameters
    ----------
    address
        Of the autopilot, as udpin:0.0.0.0:14550.
    wanted
        Names.

    Returns
    -------
    dict[str, float]
        Those that it has.
    """
    with _drivers_wanted(address):
        from hindrax_drivers.devices.ardupilot.link import Link  # noqa: PLC0415  # the wheel has no drivers

    link = Link(wanted, {})
    for _ in _listened(address, link, PATIENCE_S):
        if link.system and not link.asking:
            return link.parameters
    raise _no_answer(address, link)


def ask_autopilot(file: Path, address: str, say: Callable[[str], None] = lambda _: None) -> bool:
    """Require that the ArduSub at an address can drive the thrusters of a vehicle file; ask for a velocity, if needed.

    Nothing moves, and the line is opened once. A file that measures no velocity needs none: then an autopilot that does
    not answer yet is waited for later. Errors as those of `asked_parameters`.

    Parameters
    ----------
    file
        Of the vehicle, whatever its output is.
    address
        Of the autopilot.
    say
        Is told that its estimator is waited for: one that started within the last minute aligns first.

    Returns
    -------
    bool
        Whether its estimator claims the velocity that the file measures, by a DVL or a GPS of the autopilot's own.

    Raises
    ------
    HindraxError
        With what the autopilot lacks.
    """
    with _drivers_wanted(address):
        from hindrax_drivers.buses.clock import SystemClock  # noqa: PLC0415  # the wheel has no drivers
        from hindrax_drivers.devices.ardupilot.output import ArduSub  # noqa: PLC0415  # as above
        from hindrax_drivers.devices.ardusub_ekf import VelocityClaim  # noqa: PLC0415  # as above
        from hindrax_drivers.output.output_ports import LineOutput, Rider, set_up_patiently  # noqa: PLC0415  # as above

    wanted = bool(load_vehicle(file).measuring("velocity"))
    device = ArduSub(load_vehicle(behind_autopilot(file, address, aided=False)[0]))
    claim = VelocityClaim(ALIGNED_S, LOOK_S)
    beside = [Rider(claim, lambda _: None, lambda *_: None)] if wanted else []
    clock = SystemClock()
    with closing(LineOutput(address, device, clock, lambda *_: None, beside)) as output:
        patient = after(clock.now(), PATIENCE_S)
        while not device.identity:
            try:
                set_up_patiently(output)
            except DeviceError as error:
                if device.lack:
                    raise HindraxError(f"{address}: {device.trouble}") from error
                if not wanted:
                    return False
                if not claim.starts:  # the line cannot be opened
                    raise
                if clock.now() > patient:
                    raise _no_answer(address, claim.link) from error
        until, told = after(clock.now(), ALIGNED_S + PATIENCE_S), False
        while wanted and claim.claimed is None and clock.now() < until:
            output.wait(after(clock.now(), TURN_S))
            output.serve()
            if claim.aligning and not told:
                told = True
                say(f"waiting for the estimator of the autopilot, which started {claim.up_s:.0f} s ago")
    return bool(claim.claimed)


@contextmanager
def _drivers_wanted(address: str) -> Iterator[None]:
    """HindraxError instead of an import that fails."""
    try:
        yield
    except ImportError as error:
        raise HindraxError(
            f"{address}: to ask an autopilot needs the drivers of a clone of hindrax; give a log of it: --from dive.bin"
        ) from error


def _listened(address: str, link: "Link", seconds: float) -> Iterator[object]:
    """Messages of the autopilot on a line that is opened for it, and None after each turn of waiting."""
    from hindrax_drivers.buses.clock import SystemClock  # noqa: PLC0415  # the wheel has no drivers
    from hindrax_drivers.buses.line import open_line  # noqa: PLC0415  # as above
    from hindrax_drivers.devices.ardupilot.link import BAUD  # noqa: PLC0415  # as above

    with closing(SystemClock()) as clock, closing(open_line(address, BAUD, clock)) as line:
        until = after(clock.now(), seconds)
        patient = after(clock.now(), PATIENCE_S)
        while (now := clock.now()) < until and (link.system or now < patient):
            for order in link.tick(now):
                line.send(order)
            line.wait(after(now, TURN_S))
            data, stamp = line.read()
            yield from link.feed(data, stamp)
            yield None


def _no_answer(address: str, link: "Link") -> HindraxError:
    found = f"some parameters in {PATIENCE_S:g} s, not all" if link.system else link.stranger
    return HindraxError(
        f"{address}: found {found}, wanted an ArduSub that answers; in BlueOS add a MAVLink endpoint that sends "
        "here (Vehicle, MAVLink Endpoints)"
    )


def behind_autopilot(file: Path, address: str, *, aided: bool = True) -> tuple[Path, tuple[str, ...]]:
    """Make a copy of a vehicle file behind an ArduSub at an address; UsageError for what is no address.

    The copy has the way of driving of the file. In the place of its DVL comes the autopilot's estimator, if it is
    `aided`: as on most BlueROV2, it has no velocity where nothing gives it one.

    Parameters
    ----------
    file
        Of the vehicle.
    address
        Of the autopilot.
    aided
        Whether its estimator has a velocity.

    Returns
    -------
    tuple[Path, tuple[str, ...]]
        The copy, which stays as long as this program, and the names of the sensors that are on another line.
    """
    require_address(address)
    measured = aided and bool(load_vehicle(file).measuring("velocity"))
    data: dict[str, Any] = read_yaml(file.read_text(encoding="utf-8"), f"vehicle file {file}")
    before, output = data.get("sensors") or {}, data.get("output") or {}
    # A file may name the estimator, as that of the simulator does: it is none of velocity then either.
    kinds = tuple(kind for kind in OF_OUTPUT[DEVICE] if aided or kind != ESTIMATOR)
    own = {name: {**one, "port": ""} for name, one in before.items() if one["device"] in kinds}
    have = {one["device"] for one in own.values()}
    wanted_kinds = zip(NAMES[: 1 + measured], kinds, strict=False)
    own |= {name: {"device": kind} for name, kind in wanted_kinds if kind not in have}
    data["sensors"] = own
    data["output"] = {
        "device": DEVICE,
        "port": address,
        "control": output.get("control", "manual_control"),
        "light_channels": [],
    }
    copy = Path(tempfile.mkdtemp(prefix="hindrax-")) / file.name
    # The processes of the stack read it whenever one is started again, so it stays as long as this program.
    atexit.register(shutil.rmtree, copy.parent, ignore_errors=True)
    copy.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    load_vehicle(copy)
    return copy, tuple(name for name, one in before.items() if one["device"] not in OF_OUTPUT[DEVICE])
