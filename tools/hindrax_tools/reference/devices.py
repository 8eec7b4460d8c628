"""Pages of the devices, by the table of sensors, drivers, emulators and their faults, and of the worlds of the mock."""

import inspect
from collections.abc import Mapping
from importlib import import_module
from importlib.resources import files

import yaml

from hindrax_bringup.share_files import default_vehicle, hindrax_with, optional_sensors
from hindrax_core.driver_interface import Identity
from hindrax_core.events import after
from hindrax_core.sensor_table import SENSORS, Sensor
from hindrax_core.topics import TOPICS_OF
from hindrax_core.vehicle import Output, Vehicle, load_vehicle
from hindrax_drivers.driver_registry import driver_of
from hindrax_sim.conditions.world_table import CONDITIONS, FORM, Condition
from hindrax_sim.faults.fault_registry import FAULTS, FaultKind
from hindrax_sim.flights.lockstep_rigs import BytesRig
from hindrax_tools.reference.markdown import code, head, number, table
from hindrax_tools.reference.parameters import knob_table

ABOUT = """The devices the stack drives. Each is a driver and an emulator of the same name, golden cases from its
data sheet, and a row in `hindrax_core/sensor_table.py`; [how to add one](../how-to/new-sensor.md). The identity is the
one that the driver reports for the device of the mock vehicle. `--fault NAME:DEVICE@START+SECONDS` injects a fault.

Every device reports once a second on `/diagnostics`, as `hindrax: NAME`, with these keys: `identity`, `rate [Hz]`,
`age [s]` of the last reading, `rejects`, one `rejected: REASON` per reason and the `last reject`, `troubles` and
`last trouble`."""
OUTPUT = """Output devices make the pulses of the thrusters, behind the output guard; one of them is named by
`output` in the vehicle file. All report under `thrusters`."""
OUTPUTS = {
    "pca9685": ("pca9685", "pca9685"),
    "stm32": ("stm32", "stm32"),
    "ardusub": ("ardupilot.output", "ardupilot.firmware"),
}
"""Driver and emulator of each."""
WORLDS = f"""Effects outside the model that the mock's world can add: `--world` of `pool-test --mock`, `up --mock`,
`mock` and `montecarlo`. In *ideal* all are off; in *pool* the seed draws all of them. The form is
{FORM}. A name alone has the size given here. Shares are fractions.
[Worlds outside the model](../explanation/worlds.md) explains them."""
LISTEN_S = 4.0
WIRES = {"serial": "serial line", "i2c": "I2C", "gpio": "GPIO line"}


def page() -> str:
    """Page of the devices."""
    who = identities(load_vehicle(default_vehicle()))
    for name in optional_sensors():
        who |= identities(hindrax_with(name))
    sensors = "".join(_sensor(one, who.get(one.name, "")) for one in SENSORS)
    return f"{head('Devices', ABOUT)}{sensors}{_outputs()}{_faults()}"


def identities(vehicle: Vehicle) -> dict[str, str]:
    """Identities that the drivers read from the mock vehicle."""
    rig = BytesRig(vehicle, seed=1)
    end = after(rig.world.stamp, LISTEN_S)
    while rig.world.stamp < end:
        rig.advance()
    return {name: identity.text for name, identity in rig.log if isinstance(identity, Identity)}


def _sensor(sensor: Sensor, identity: str) -> str:
    row = driver_of(sensor.name)
    topics = TOPICS_OF[sensor.name].values()
    facts = {
        "measures": ", ".join(sensor.measures),
        "wire": WIRES[sensor.wire],
        "identity": code(identity),
        "driver": _about(sensor.driver_module),
        "emulator": _about(sensor.emulator_module),
        "golden cases": code(f"test/golden/{sensor.name}/cases.yaml"),
        "raw frames": code(f"raw/{sensor.name}"),
        "faults": ", ".join(code(kind.name) for kind in FAULTS.values() if kind.falls_on(sensor)),
    }
    published = table(
        ("publishes", "type", "rate [Hz]", "meaning"),
        [(code(one.name), code(one.type), number(one.rate_Hz), one.meaning) for one in topics],
    )
    settings = f"Settings:\n\n{knob_table(row.knobs)}"
    return f"\n## {sensor.name}: {sensor.meaning}\n\n{_facts(facts)}\n{published}\n{settings}{_offers(sensor.name)}"


def offers() -> Mapping[str, list[tuple[str, str, bool, str]]]:
    """What the manual of each device offers: offer, page, whether it is served, how or why not."""
    text = (files("hindrax_drivers.devices") / "offers.yaml").read_text("utf-8")
    # As text: section 8.30 is no number.
    found = yaml.load(text, yaml.BaseLoader)  # noqa: S506  # our own file, and the loader makes only text
    return {
        name: [(what, page, served == "true", note) for what, page, served, note in rows]
        for name, rows in found.items()
    }


def _offers(name: str) -> str:
    """Table of what the manual offers; nothing for a device without a list."""
    rows = [(what, page, "yes" if served else "no", note) for what, page, served, note in offers().get(name, [])]
    if not rows:
        return ""
    return f"\nThe manual, and what is supported:\n\n{table(('offers', 'page', 'served', 'how, or why not'), rows)}"


def _outputs() -> str:
    rows = [
        (code(name), _about(f"hindrax_drivers.devices.{driver}"), _about(f"hindrax_sim.devices.{emulator}"))
        for name, (driver, emulator) in OUTPUTS.items()
    ]
    listed = table(("device", "driver", "emulator"), rows)
    return (
        f"\n## Outputs\n\n{OUTPUT}\n\n{listed}\nSettings, under `output` of the vehicle file:\n\n{knob_table(Output)}"
        + "".join(f"\n### {name}\n{_offers(name)}" for name in OUTPUTS)
    )


def _faults() -> str:
    def wire(kind: FaultKind) -> str:
        where = {"serial": kind.make, "I2C": kind.on_bus, "world": kind.on_world}
        return ", ".join(name for name, made in where.items() if made is not None)

    rows = [(code(kind.name), wire(kind), ", ".join(kind.devices()), kind.meaning) for kind in FAULTS.values()]
    return f"\n## Faults\n\n{table(('name', 'kind', 'devices', 'what happens'), rows)}"


def _facts(facts: Mapping[str, str]) -> str:
    return "".join(f"- {name}: {value}\n" for name, value in facts.items())


def _about(module: str) -> str:
    """First sentence of a module's text, and its file."""
    text = inspect.getdoc(import_module(module)) or ""
    return f"{' '.join(text.partition(chr(10) * 2)[0].split())} ({code(module.replace('.', '/') + '.py')})"


def worlds_page() -> str:
    """Page of the worlds."""
    columns = ("name", "size", "in pool", "how it acts", "where the size comes from")
    return f"{head('Worlds of the mock', WORLDS)}\n{table(columns, map(_condition, CONDITIONS.values()))}"


def _condition(row: Condition) -> tuple[str, ...]:
    unit = "" if row.unit == "-" else f" {row.unit}"
    return (code(row.name), f"{number(row.size)}{unit}", f"{row.draw}{unit}", row.meaning, row.source)
