"""The vehicle that an ArduSub says it has: frame, which output drives which thruster, and its sense.

ArduSub's public sources and parameter list: `FRAME_CONFIG` (1 vectored, 2 vectored with six degrees of freedom),
`SERVOn_FUNCTION` 33 to 40 (motor 1 to 8 at output n), `MOT_n_DIRECTION` (1 or -1). What no parameter knows (hull,
positions, curves) is that of the vehicle file, or of the BlueROV2 in the box.

`SERVOn_REVERSED` turns a motor only where `MOT_PWM_TYPE` scales its pulses (`AP_Motors::rc_write`). An ArduSub 4.6 in
a SITL gave output 1 the same 1560 us with it and without, and 1440 us with `MOT_1_DIRECTION` -1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hindrax_analysis.records.ardupilot_log import read_starts
from hindrax_analysis.records.blueos_recording import recordings
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import VEHICLE_OF_FRAME, Thruster, Vehicle

BOX = frozenset(VEHICLE_OF_FRAME.values())
"""Vehicles in the box that an ArduSub drives: their files have ArduSub's own directions and outputs."""
FIRST_MOTOR, MOST_MOTORS, OUTPUTS = 33, 8, 16
LOGS = (".bin", ".tlog")
FRAME, LOW_V, PULSES_us = "FRAME_CONFIG", "BATT_LOW_VOLT", {"MOT_PWM_MIN": 1100.0, "MOT_PWM_MAX": 1900.0}
"""Parameters of the frame, of the voltage that counts as low (0: none), and of the ends of pulses, with defaults."""
PULSE_TYPE, SCALED = "MOT_PWM_TYPE", (8.0, 9.0)
"""Kind of pulses; PWMRange and PWMAngle, by which an output's own settings hold for a motor."""
SIMULATION = "SIM_"
"""Begin of the parameters of ArduPilot's simulator (SITL), which no autopilot has."""
PARAMETERS = (
    FRAME,
    f"{SIMULATION}BUOYANCY",
    PULSE_TYPE,
    LOW_V,
    *PULSES_us,
    *(f"SERVO{output}_{what}" for output in range(1, OUTPUTS + 1) for what in ("FUNCTION", "REVERSED")),
    *(f"MOT_{motor}_DIRECTION" for motor in range(1, MOST_MOTORS + 1)),
)
"""All that a vehicle file takes from an autopilot."""
A_SIMULATOR = "by its SIM_ parameters it is ArduPilot's simulator"
OF_THE_SIMULATOR = (
    f"{A_SIMULATOR}, whose thrust, levers and water are not those of {{kind}}: "
    "`./hindrax vehicle new NAME --from LOG` makes the file of its vehicle"
)
"""Sentence about a vehicle of the box in the simulator's place."""


@dataclass(frozen=True, slots=True)
class Wiring:
    """Frame of an ArduSub; for each motor (from 1) its channel (from 0) and whether it turns the other way.

    `simulated`: its vehicle is that of ArduPilot's simulator, which is none of the box.
    """

    frame: int
    motors: Mapping[int, tuple[int, bool]]
    simulated: bool = False

    @property
    def kind(self) -> str:
        """Vehicle in the box with this frame; empty for another."""
        return VEHICLE_OF_FRAME.get(self.frame, "")

    @property
    def turned(self) -> tuple[int, ...]:
        """Motors that turn the other way than those of the frame."""
        return tuple(motor for motor, (_, backwards) in sorted(self.motors.items()) if backwards)


def wiring_of(parameters: Mapping[str, float]) -> Wiring | None:
    """Wiring by the parameters of an ArduSub; None where they hold no frame, as in a log that began before them."""
    if FRAME not in parameters:
        return None
    motors = {}
    for output in range(1, OUTPUTS + 1):
        motor = round(parameters.get(f"SERVO{output}_FUNCTION", 0.0)) - FIRST_MOTOR + 1
        if 1 <= motor <= MOST_MOTORS:
            backwards = parameters.get(f"MOT_{motor}_DIRECTION", 1.0) < 0.0
            scaled = parameters.get(PULSE_TYPE, 0.0) in SCALED
            turned = scaled and parameters.get(f"SERVO{output}_REVERSED", 0.0) > 0.0
            motors[motor] = (output - 1, backwards != turned)
    simulated = any(name.startswith(SIMULATION) for name in parameters)
    return Wiring(round(parameters[FRAME]), motors, simulated)


def logged_wiring(paths: Sequence[Path]) -> Wiring | None:
    """Wiring in the first of some logs that has it."""
    return wiring_of(logged_parameters(paths))


def logged_parameters(paths: Sequence[Path]) -> Mapping[str, float]:
    """Parameters in the first of some logs that has a frame; none where no log has one."""
    for path in paths:
        is_log = path.suffix.lower() in LOGS and path.is_file() and path.stat().st_size
        for log in [path] if is_log else recordings(path):
            for start in read_starts(log):
                if FRAME in start.parameters:
                    return start.parameters
    return {}


def wired(
    vehicle: Vehicle, wiring: Wiring, remedy: str = "name the vehicle file of this vehicle with --vehicle"
) -> Vehicle:
    """Connect a vehicle as an ArduSub does.

    Parameters
    ----------
    vehicle
        With thrusters T1 to Tn in their order.
    wiring
        Outputs and senses of the motors.
    remedy
        What to do where the file has another number of thrusters.

    Returns
    -------
    Vehicle
        With the channels and senses of the wiring.

    Raises
    ------
    UsageError
        Where the file has another number of thrusters.
    """
    if wiring.motors and len(wiring.motors) != len(vehicle.thrusters):
        numbers = ", ".join(map(str, sorted(wiring.motors)))
        raise UsageError(
            f"{vehicle.name}: has {len(vehicle.thrusters)} thrusters, the autopilot drives {len(wiring.motors)} "
            f"(by its SERVOn_FUNCTION motors {numbers}); {remedy}"
        )
    thrusters = tuple(_wired(one, wiring.motors.get(index)) for index, one in enumerate(vehicle.thrusters, start=1))
    return replace(vehicle, thrusters=thrusters)


def _wired(thruster: Thruster, output: tuple[int, bool] | None) -> Thruster:
    if output is None:
        return thruster
    channel, reversed_ = output
    return replace(thruster, channel=channel, reversed=reversed_)
