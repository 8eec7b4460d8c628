"""A vehicle file flown by an autopilot at an address: what it measures, and nothing that is not on its line."""

import atexit
import math
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
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

DEVICE = "ardusub"
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


def require_fit(file: Path, address: str) -> None:
    """Require that the ArduSub at an address can drive the thrusters of a vehicle file; nothing moves.

    One that does not answer yet is waited for later.

    Parameters
    ----------
    file
        Of the vehicle, whatever its output is.
    address
        Of the autopilot.

    Raises
    ------
    HindraxError
        With what the autopilot lacks.
    """
    with _drivers_wanted(address):
        from hindrax_drivers.buses.clock import SystemClock  # noqa: PLC0415  # the wheel has no drivers
        from hindrax_drivers.devices.ardupilot.output import ArduSub  # noqa: PLC0415  # as above
        from hindrax_drivers.output.output_ports import LineOutput, set_up_patiently  # noqa: PLC0415  # as above

    device = ArduSub(load_vehicle(behind_autopilot(file, address, aided=False)[0]))
    output = LineOutput(address, device, SystemClock(), lambda _stamp, _sent, _data: None)
    with closing(output), suppress(DeviceError):
        set_up_patiently(output)
    if device.lack:
        raise HindraxError(f"{address}: {device.trouble}")


def has_velocity(address: str, say: Callable[[str], None] = lambda _: None) -> bool:
    """Whether the estimator of an ArduSub claims a velocity, by a DVL or a GPS of the autopilot's own.

    One that started within the last minute aligns first: it is waited for. Errors as those of `asked_parameters`.

    Parameters
    ----------
    address
        Of the autopilot.
    say
        Is told that it is waited for.

    Returns
    -------
    bool
        True as soon as it claims one.
    """
    with _drivers_wanted(address):
        from hindrax_drivers.devices.ardupilot.link import Link  # noqa: PLC0415  # the wheel has no drivers
        from hindrax_drivers.devices.ardusub_ekf import STATUS_Hz, claims_velocity  # noqa: PLC0415  # as above
        from hindrax_drivers.protocols.ardupilot import (  # noqa: PLC0415  # as above
            ATTITUDE,
            EKF_STATUS,
            Attitude,
            EstimatorStatus,
        )

    link = Link((), {EKF_STATUS: STATUS_Hz, ATTITUDE: STATUS_Hz})
    claims: list[bool] = []
    told, up_s = False, math.inf
    for message in _listened(address, link, ALIGNED_S + PATIENCE_S):
        if isinstance(message, Attitude):
            up_s = 1e-3 * message.boot_ms
        elif isinstance(message, EstimatorStatus):
            claims.append(claims_velocity(message))
            if claims[-1]:
                return True
            if up_s > ALIGNED_S and len(claims) >= LOOK_S * STATUS_Hz:
                return False
            if up_s <= ALIGNED_S and not told:
                told = True
                say(f"waiting for the estimator of the autopilot, which started {up_s:.0f} s ago")
    if not link.system:
        raise _no_answer(address, link)
    return False


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
    who = (link.foreign and "an autopilot that is no ArduPilot") or "no heartbeat of an ArduPilot"
    found = f"some parameters in {PATIENCE_S:g} s, not all" if link.system else who
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
        The copy, which stays as long as this program, and the names of the sensors that were left out.
    """
    require_address(address)
    measured = aided and bool(load_vehicle(file).measuring("velocity"))
    data: dict[str, Any] = read_yaml(file.read_text(encoding="utf-8"), f"vehicle file {file}")
    before, output = data.get("sensors") or {}, data.get("output") or {}
    kinds = OF_OUTPUT[DEVICE]
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
    return copy, tuple(name for name in before if name not in own)
