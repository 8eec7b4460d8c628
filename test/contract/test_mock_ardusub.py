"""The mock vehicle behind an ArduSub: output and sensors on one line, over a pty and the mock's clock."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from hindrax_core.driver_interface import Output
from hindrax_core.events import Stamp, Stamped, stamp_from_s
from hindrax_core.readings import Inertial, Pressure, Reading
from hindrax_core.vehicle import Mount, Vehicle, load_vehicle
from hindrax_drivers.devices.ardupilot.output import ArduSub
from hindrax_drivers.devices.ardusub import ArduSub as Sensor
from hindrax_drivers.output.output_guard import Pulses
from hindrax_drivers.output.output_ports import LineOutput, Rider
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import MockVehicle

HEAVY = load_vehicle(Path(__file__).parents[2] / "src/hindrax_bringup/vehicles/bluerov2-heavy.yaml")
AHEAD = (1420.0, 1420.0, 1580.0, 1580.0, 1500.0, 1500.0, 1500.0, 1500.0)


def behind_ardusub() -> Vehicle:
    output = replace(HEAVY.output, device="ardusub", port="udpin:0.0.0.0:14550")
    return replace(HEAVY, output=output, sensors={"autopilot": Mount("ardusub")})


class Beside:
    """The mock's time for one that is stepped in the same thread."""

    def __init__(self, mock: MockVehicle) -> None:
        self._mock = mock

    def now(self) -> Stamp:
        return self._mock.hardware.stamp

    def sleep_until(self, *_words: object, **_more: object) -> None:
        self._mock.step()

    def wake(self) -> None:
        pass

    def close(self) -> None:
        pass


def test_one_line_carries_thrust_and_what_the_autopilot_measures(tmp_path: Path) -> None:
    vehicle = behind_ardusub()
    assert vehicle.on_output_line == ("autopilot",)
    readings: list[Reading] = []
    frames: dict[str, list[bytes]] = {"thrusters": [], "autopilot": []}

    def deliver(outputs: Iterable[Output]) -> None:
        readings.extend(one.reading for one in outputs if isinstance(one, Stamped))

    rider = Rider(Sensor(), deliver, lambda _stamp, _sent, data: frames["autopilot"].append(data))
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=0.0) as mock:
        assert list(mock.ports) == ["thrusters"]
        output = LineOutput(
            mock.ports["thrusters"],
            ArduSub(vehicle),
            Beside(mock),
            lambda _stamp, _sent, data: frames["thrusters"].append(data),
            [rider],
        )
        assert output.set_up().startswith("ArduSub 4.5.1, system 1, driven by MANUAL_CONTROL")
        end = mock.hardware.stamp + stamp_from_s(3.0)
        while mock.hardware.stamp < end:
            output.write(Pulses(AHEAD, ()), armed=True)
            output.wait(Stamp(mock.hardware.stamp + 20_000_000))
            output.serve()
        assert mock.hardware.output.pulses_us()[:8] == AHEAD
        made = output.applied(Pulses(AHEAD, ()))
        assert made.reading.pulses_us == AHEAD
        assert made.stamp < mock.hardware.stamp, "when the autopilot had them, not now"
        assert mock.hardware.world.plant.u > 0.1
        kinds = [type(one) for one in readings]
        assert kinds.count(Inertial) > 280
        assert kinds.count(Pressure) > 55
        assert frames["autopilot"][0] == b"", "a replay restarts the driver there"
        received = [data for data in frames["thrusters"] if data[:1] == b"\xfd"]
        assert set(received[-20:]) & set(frames["autopilot"]), "each keeps what it has read"
        output.close()
