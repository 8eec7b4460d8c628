"""An unmodified ArduSub as the thruster output, over MAVLink.

Two ways (ADR 57). By `manual_control`, as a joystick: the sticks that come nearest to the wanted pulses, in MANUAL,
through the autopilot's own mixer and the pilot's gain. By `motor_test`: each thruster's pulse, MAV_CMD_DO_MOTOR_TEST.
Either way SERVO_OUTPUT_RAW says what every thruster really got, and that is what is reported as applied, with the time
at which the autopilot says it was so. Whether the autopilot is there is judged by the arrival of its messages alone.

    idle --arm--> arming: MANUAL, then arm --accepted--> armed --disarm--> leaving --confirmed--> idle
    armed --another party, a failsafe, a restart--> ended: a neutral stick, then silence, until it is armed anew
    armed --a lost link, silence of our own--> leaving, as soon as it is heard again

Who took over keeps the vehicle: after that nothing is sent that could move it, nor a disarm. What was armed from here
and nobody took over is disarmed from here: without FS_PILOT_INPUT 2 (disarm) it would stay armed at neutral for good.
"""

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum

from hindrax_core.driver_interface import Identity, Output, Send, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, after, seconds_between
from hindrax_core.readings import AppliedPulses, Battery, DeviceText
from hindrax_core.text.refusals import TAKEN_OVER, THRUSTERS_BY_HAND
from hindrax_core.vehicle import VEHICLE_OF_FRAME, Vehicle
from hindrax_drivers.devices.ardupilot.link import (
    ACCEPTED,
    ATTEMPTS,
    BAUD,
    IN_PROGRESS,
    LATENCY_S,
    Handlers,
    Link,
    no_submarine,
)
from hindrax_drivers.devices.ardupilot.mixer import FACTORS, CENTER_us, Mixer, Motor, push_of, thrust_table
from hindrax_drivers.protocols import ardupilot
from hindrax_drivers.protocols.ardupilot import (
    ARM,
    MOTOR_TEST,
    SET_MODE,
    NamedFloat,
    RcChannels,
    ServoOutput,
    Supply,
    Version,
)
from hindrax_drivers.protocols.mavlink import CommandAck, Heartbeat, StatusText
from hindrax_drivers.timebase import RESTART_us, Timebase, came_again

MANUAL = 19
"""ArduSub's number of its mode."""
FIRST_MOTOR, MOST_MOTORS = 33, 8
SIX_AXES, SIX_AXES_OF_4_1, AFTER_4_1 = (4, 5, 0), (4, 1, 2), (4, 2, 0)
"""Release of ArduSub from which MANUAL_CONTROL has pitch and roll; the one of 4.1 that has them too, and its end."""
SEVERITY_WARNING = 4
OPPOSITE, ALONGSIDE, ROUNDING = -0.5, 0.3, 1e-9
"""Cosines of 120 and 73 degrees: beyond, a thruster is turned round; between 73 and 107 it is that of another frame."""
ASK_AGAIN_S = 0.4
"""Time for an answer to arming, disarming and the mode."""
REPEAT_S, STICKS_S = 0.1, 0.2
"""Time between motor tests without a change (they end after 0.5 s), and between the neutral sticks beside them."""
PAUSE_S = 10.0
"""What ArduSub asks for after a motor test that has timed out, as every one does that is ended."""
SEEN_S, ODD_LIMIT, MEMORY_S = 0.7, 4, 3.0
"""Delay in which what was asked may show; so many samples in this time that nobody here asked for are a stranger's.

An autopilot acts on the sticks that came last before its turn, 50 in a second, as many as ours: of a stranger's, 10 in
a second, nine in ten may come just before one of ours, and are never seen.
"""
STICK_TOLERANCE_us, PULSE_TOLERANCE_us = 8.0, 3.0
PUSH_us, MOST_AT_REST = 20.0, 8
"""A stick so far off neutral moves some thruster in every frame; samples at rest meanwhile, 0.16 s, are of no delay."""
CONFIRMED_S = 2.5
"""Time from an accepted arming by which the heartbeat says so."""
FRESH_S = 1.0
WORDS_S = 2.0
"""Age of a text that can be the reason of what a heartbeat shows: its period, and the delay of a link."""
WRAP_us = 2**32
"""Length of the autopilot's clock."""
HALF_us = 400.0
"""Way of a stick to either end."""
FAREWELLS = 3
TEST_TIMEOUT_S, PILOT_TIMEOUT_S = 0.5, 3.0
"""Silence after which the autopilot goes neutral: by motor test; by sticks, where FS_PILOT_TIMEOUT is not known."""
SERVO_Hz, STICKS_Hz = 50.0, 40.0
"""Sticks are looked at in another rhythm than ours are sent in: else each look might fall just behind one of ours."""
PARAMETERS = (
    "FRAME_CONFIG",
    *(f"SERVO{number}_FUNCTION" for number in range(1, 17)),
    *(f"MOT_{number}_DIRECTION" for number in range(1, MOST_MOTORS + 1)),
    *("MOT_PWM_MIN", "MOT_PWM_MAX", "JS_GAIN_DEFAULT", "JS_THR_GAIN"),
    *("FS_PILOT_INPUT", "FS_PILOT_TIMEOUT", "FS_GCS_ENABLE", "FS_EKF_ACTION", "FS_LEAK_ENABLE"),
)
# Named values (gain, input hold) come by themselves; asked for them, it answers with a text to every station.
STREAMS = {ardupilot.SERVO_OUTPUT: SERVO_Hz, ardupilot.RC_CHANNELS: STICKS_Hz, ardupilot.SYS_STATUS: 2.0}
NEEDED = {ardupilot.SERVO_OUTPUT: "SERVO_OUTPUT_RAW", ardupilot.RC_CHANNELS: "RC_CHANNELS"}
"""Without the one nobody knows what the thrusters get, without the other not who moves the sticks."""
NO_ANSWER = (
    "it does not answer for {name}, which every ArduSub has; check the link, which loses messages, and try again"
)
FILE_OF_LOG = "take the file of this vehicle: `./hindrax vehicle new NAME --from LOG`"
MODES = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    4: "GUIDED",
    7: "CIRCLE",
    9: "SURFACE",
    16: "POSHOLD",
    19: "MANUAL",
    20: "MOTOR_DETECT",
    21: "SURFTRAK",
}
BUSY = {"InputHold": "its input hold is engaged", "RollPitch": "its sticks are set to roll and pitch"}
"""Values that ArduSub names, where they are not zero, and why nobody should arm then."""


class Phase(StrEnum):
    """Phase of the output: only `ARMED` moves a thruster."""

    IDLE = "idle"
    ARMING = "arming"
    ARMED = "armed"
    LEAVING = "leaving"


class ArduSub:
    """The link to one ArduSub, for the thrusters of a vehicle file in their order."""

    baud = BAUD

    def __init__(
        self, vehicle: Vehicle, streams: Mapping[int, float] | None = None, *, left_armed: bool = False
    ) -> None:
        """`streams`: further ones, for sensors on the same link [Hz]; `left_armed`: by the process before this one."""
        self._vehicle, self._by_test = vehicle, vehicle.output.control == "motor_test"
        self._link = Link(PARAMETERS, {**STREAMS, **(streams or {})})
        self._clock = Timebase(1e-6, latency_s=LATENCY_S)
        self._asked = False
        self._owned = left_armed
        """Whether it was armed from here, and neither disarmed since nor taken over."""
        self._pause_until = self._sticks_at = self._tests_at = Stamp(0)
        self._handlers = Handlers()
        self._handlers.on(ServoOutput, self._on_servos)
        self._handlers.on(RcChannels, self._on_sticks)
        self._handlers.on(CommandAck, self._on_answer)
        self._handlers.on(NamedFloat, self._on_named)
        self._handlers.on(Supply, self._on_supply)
        self._handlers.on(StatusText, self._on_text)
        self._reset(Stamp(0))

    # ---- state

    @property
    def identity(self) -> str:
        """Who answers; empty before."""
        return self._identity

    @property
    def lack(self) -> str:
        """What this autopilot lacks, or what is wrong with it; empty where it will do, or is not known yet."""
        return self._lack

    @property
    def settling(self) -> bool:
        """Whether it has answered, and is still being asked."""
        return self._link.system != 0 and not self._lack and not self._identity

    @property
    def ready(self) -> bool:
        """Whether it is as wanted, and speaks."""
        speaks = self._link.alive(self._now) and seconds_between(self._served_at, self._now) <= FRESH_S
        return bool(self._identity) and not self._lack and not self._restarted and speaks

    @property
    def trouble(self) -> str:
        """Why it is not ready."""
        if self._lack:
            return f"ardusub: {self._lack}"
        if self._restarted:
            return "ardusub: the autopilot has restarted"
        if not self._link.system:
            wanted = "wanted the heartbeat of an ArduSub; check address, power and router"
            return f"ardusub: {self._link.stranger}, {wanted}"
        silent = "heartbeat" if not self._link.alive(self._now) else "SERVO_OUTPUT_RAW"
        return f"ardusub: no {silent} any more; check power and line" if self._identity else "ardusub: still answering"

    def fault(self) -> str:
        """Why it does not follow although it should be armed; empty where it does, or is about to."""
        if not self._asked or self._phase in (Phase.ARMING, Phase.ARMED):
            return ""
        return self._ended or "the autopilot is not armed"

    @property
    def left_armed(self) -> bool:
        """Whether it was armed from here, should be so no more, and does not say that it is disarmed."""
        unconfirmed = self._phase is Phase.LEAVING and (self._cut_off or self._tries > 1)
        return self._owned and (unconfirmed or self._phase is Phase.IDLE)

    @property
    def owned(self) -> bool:
        """Whether it was armed from here, and neither disarmed since nor taken over, as far as is known."""
        return self._owned

    # ---- the line

    def start(self, stamp: Stamp) -> Iterable[Output]:
        """Begin anew after the line was opened."""
        self._reset(stamp)
        return list(self._link.tick(stamp))

    def feed(self, data: bytes, stamp: Stamp) -> Iterable[Output]:
        """Decode received bytes."""
        outputs = self._watch_ourselves(stamp)
        for message in self._link.feed(data, stamp):
            if isinstance(message, Rejected):
                outputs.append(message)
            else:
                outputs += self._handlers.outputs(message, stamp)
        return outputs

    def tick(self, stamp: Stamp) -> Iterable[Output]:
        """Heartbeats, requests, and the steps of arming and disarming."""
        self._now = stamp
        outputs: list[Output] = [*self._link.tick(stamp), *self._reconsider(stamp)]
        outputs += self._identify(stamp)
        if self._phase in (Phase.ARMING, Phase.LEAVING) and seconds_between(self._step_at, stamp) >= ASK_AGAIN_S:
            outputs += self._step(stamp)
        return outputs

    def drive(
        self, thrusters_us: tuple[float, ...], lights_us: tuple[float, ...], stamp: Stamp, *, armed: bool
    ) -> Iterable[Output]:
        """Pass on the wanted pulses of the thrusters; arm once when they may move, disarm when they may no longer.

        Parameters
        ----------
        thrusters_us : [us]
            In the order of the vehicle file.
        lights_us : [us]
            Lamps are the autopilot's own.
        stamp
            Now.
        armed
            Whether they may be other than neutral.

        Returns
        -------
        Iterable[Output]
            Frames to send, and troubles.
        """
        del lights_us
        outputs = self._watch_ourselves(stamp)
        if armed and not self._asked:
            outputs += self._begin(stamp)
        self._asked = armed
        if armed and self._phase is Phase.ARMED:
            outputs += self._watch_beat(stamp)
        if armed and self._phase is Phase.ARMED:
            outputs += self._move(thrusters_us, stamp) if self._rest_at is None else self._stick(stamp)
        elif armed and self._phase is Phase.ARMING:
            outputs += self._stick(stamp)
        elif not armed and self._phase in (Phase.ARMING, Phase.ARMED):
            outputs += self._leave(stamp)
        return outputs

    # ---- who is there

    def _reset(self, stamp: Stamp) -> None:
        self._link.restart(stamp)
        self._phase, self._ended, self._lack, self._identity = Phase.IDLE, "", "", ""
        self._mixer: Mixer | None = None
        self._motors: tuple[Motor, ...] = ()
        self._named: dict[str, float] = {}
        self._last_text = self._refused = self._unexplained = ""
        self._begun = (0, "")
        """Text of which not all parts have come: its number, and what has."""
        self._restarted = self._seen_armed = self._tested = self._thrust = False
        self._clock.restart()
        self._boot_us = self._overflows = self._tries = self._at_rest = 0
        self._now = stamp
        self._step_at = self._armed_at = self._served_at = self._accepted_at = self._text_at = Stamp(0)
        self._sticks_seen_at = Stamp(0)
        self._sent: list[int] = []
        self._history: deque[tuple[Stamp, tuple[float, ...]]] = deque(maxlen=256)
        self._odd: deque[Stamp] = deque()
        self._rest_at: Stamp | None = None
        self._moved = self._cut_off = False
        """Whether sticks (by motor test, thrusters) are off neutral; whether it was out of our reach while armed."""

    def _identify(self, stamp: Stamp) -> list[Output]:
        if self._identity or self._lack or not self._link.beat or self._link.asking:
            return []
        self._lack = self._find_lack()
        if self._lack:
            return [Trouble(stamp, f"ardusub: {self._lack}")]
        self._served_at = stamp
        version = f" {self._link.version}" if self._link.version else ""
        way = "motor tests" if self._by_test else "MANUAL_CONTROL"
        others = ", ".join(f"{system}/{component}" for system, component in sorted(self._link.stations))
        beside = f", beside the ground station {others}" if others else ""
        self._identity = f"ArduSub{version}, system {self._link.system}, driven by {way}{beside}"
        return [Identity(self._identity), *(self._take_back(stamp) if self._owned else ())]

    def _reconsider(self, stamp: Stamp) -> list[Output]:
        """Judge it anew where somebody has changed one of its parameters; a flight by the old ones ends."""
        changed, self._link.changed = self._link.changed, ""
        if not changed or not self._identity:
            return []
        self._identity = ""
        if self._phase not in (Phase.ARMING, Phase.ARMED):
            return []
        return self._end(f"another party has changed its {changed}", stamp, owned=True)

    def _find_lack(self) -> str:
        parameters = self._link.parameters
        if other := no_submarine(self._link.beat):
            return other
        if "FRAME_CONFIG" not in parameters:
            return "it does not answer for FRAME_CONFIG, wanted an ArduSub of release 4.1 or later"
        if missing := [name for number, name in NEEDED.items() if number in self._link.refused]:
            return f"it does not stream {missing[0]} on request (SET_MESSAGE_INTERVAL), wanted ArduSub 4.1 or later"
        return self._find_motors() or self._find_frame() or ("" if self._by_test else self._find_mixer())

    def _find_motors(self) -> str:
        """Map the thrusters of the file to motors; why that cannot be done."""
        parameters, motors = self._link.parameters, []
        for thruster in self._vehicle.thrusters:
            output = thruster.channel + 1
            if (asked := f"SERVO{output}_FUNCTION") not in parameters:
                return NO_ANSWER.format(name=asked)
            function = round(parameters[asked])
            number = function - FIRST_MOTOR + 1
            if not 1 <= number <= MOST_MOTORS:
                return (
                    f"{thruster.name} is at output {output} in the vehicle file, where SERVO{output}_FUNCTION is "
                    f"{function}, wanted a motor, {FIRST_MOTOR} to {FIRST_MOTOR + MOST_MOTORS - 1}; "
                    f"{self._other_file()}"
                )
            if (asked := f"MOT_{number}_DIRECTION") not in parameters:
                return NO_ANSWER.format(name=asked)
            sense = -1.0 if parameters[asked] < 0.0 else 1.0
            curve = self._vehicle.curves[thruster.curve]
            table = thrust_table(curve, self._vehicle.supply_V, mirrored=thruster.reversed)
            motors.append(Motor(number, thruster.channel, sense, *table))
        self._motors = tuple(motors)
        return ""

    def _other_file(self) -> str:
        """Where a vehicle file with the motors of this autopilot comes from."""
        frame = self._link.parameters.get("FRAME_CONFIG")
        return FILE_OF_LOG if frame in VEHICLE_OF_FRAME else THRUSTERS_BY_HAND

    def _find_frame(self) -> str:
        """Why its frame is not that of the vehicle file; empty where it is, or is not known and need not be."""
        frame = round(self._link.parameters["FRAME_CONFIG"])
        if frame not in FACTORS:
            wanted = "wanted another, or `control: motor_test` under output"
            return "" if self._by_test else f"its FRAME_CONFIG is {frame}, whose motors are not known; {wanted}"
        if max(one.number for one in self._motors) > len(FACTORS[frame]):
            return (
                f"its FRAME_CONFIG is {frame}, with {len(FACTORS[frame])} motors that are known, and the vehicle file "
                f"has {len(self._motors)}; {self._other_file()}, or set the frame that it has"
            )
        others = {} if self._by_test else self._others(frame)  # those rest while none is tested
        if others:
            numbers, outputs = (", ".join(map(str, those)) for those in (others, others.values()))
            return (
                f"its frame {frame} drives motors {numbers} too, at outputs {outputs}, which are no thrusters of the "
                f"vehicle file; {self._other_file()}"
            )
        return self._find_pushes(frame)

    def _find_mixer(self) -> str:
        parameters, version = self._link.parameters, self._link.version
        frame = round(parameters["FRAME_CONFIG"])
        if unsafe := self._find_failsafe():
            return unsafe
        mixer = Mixer(frame, self._motors, parameters.get("MOT_PWM_MIN", 1100.0), parameters.get("MOT_PWM_MAX", 1900.0))
        if mixer.pitches and (version is None or not _has_six_axes(version)):
            return (
                f"its release is {version or 'unknown'}, whose MANUAL_CONTROL has no pitch and roll, wanted 4.1.2, or "
                "4.5 or later; update ArduSub"
            )
        self._mixer = mixer
        return ""

    def _find_failsafe(self) -> str:
        """Why nothing would stop the thrusters without us; empty where something does."""
        if (asked := "FS_PILOT_INPUT") not in self._link.parameters:
            return NO_ANSWER.format(name=asked)
        if self._link.parameters[asked] == 0.0:
            return (
                "its FS_PILOT_INPUT is 0: nothing would stop the thrusters when this computer falls silent; set it to "
                "2 (disarm)"
            )
        return ""

    def _others(self, frame: int) -> dict[int, int]:
        """Outputs of the motors that its mixer drives and the file does not have, by their numbers."""
        known = {one.number for one in self._motors}
        functions = {output: self._link.parameters.get(f"SERVO{output}_FUNCTION", 0.0) for output in range(1, 17)}
        wired = {round(function) - FIRST_MOTOR + 1: output for output, function in functions.items()}
        return {number: wired[number] for number in range(1, len(FACTORS[frame]) + 1) if number in wired.keys() - known}

    def _find_pushes(self, frame: int) -> str:
        """Why the thrusters of the file do not push where those of the frame do; empty where they do."""
        if across := self._pushing(frame, -ALONGSIDE, ALONGSIDE):
            return (
                f"its frame {frame} has {', '.join(across)} pushing across what the vehicle file says: that is "
                f"the file of another frame; {self._other_file()}"
            )
        if backwards := self._pushing(frame, -1.0, OPPOSITE):
            return (
                f"its frame {frame} has {', '.join(backwards)} the other way round than the vehicle file; turn them in"
                f" the file{f', or {FILE_OF_LOG}' if frame in VEHICLE_OF_FRAME else ''}"
            )
        return ""

    def _pushing(self, frame: int, least: float, most: float) -> list[str]:
        """Thrusters of the file whose push has a cosine between these to the frame's: its pilot would know them."""
        found = []
        for thruster, motor in zip(self._vehicle.thrusters, self._motors, strict=True):
            sense = motor.direction * (-1.0 if thruster.reversed else 1.0)
            push = push_of(frame, motor.number)
            along = sense * sum(one * other for one, other in zip(thruster.direction, push, strict=True))
            if least - ROUNDING <= along / math.hypot(*push) < most:
                found.append(thruster.name)
        return found

    # ---- what it says

    def _on_named(self, message: NamedFloat, _stamp: Stamp) -> list[Output]:
        self._named[message.name] = message.value
        return []

    def _on_supply(self, message: Supply, stamp: Stamp) -> list[Output]:
        known = math.isfinite(message.voltage_V)
        return [Stamped(stamp, Battery(message.voltage_V, message.current_A))] if known else []

    def _on_sticks(self, message: RcChannels, stamp: Stamp) -> list[Output]:
        self._sticks_seen_at = stamp
        sticks = tuple(map(float, message.pulses_us[:6]))
        return [] if self._by_test else self._compare(sticks, STICK_TOLERANCE_us, "stick", stamp)

    def _on_text(self, message: StatusText, stamp: Stamp) -> list[Output]:
        """A text of more than 50 bytes comes in parts, and is one once the last is here."""
        number, begun = self._begun
        text = (begun if number == message.number else "") + message.text
        self._begun = (message.number, text) if message.more else (0, "")
        return [] if message.more else self._on_sentence(replace(message, text=text), stamp)

    def _on_sentence(self, message: StatusText, stamp: Stamp) -> list[Output]:
        if message.severity <= SEVERITY_WARNING:
            self._last_text, self._text_at = message.text, stamp
            trouble = Trouble(stamp, f"ardusub: {message.text}")
            waited_for = self._unexplained and self._phase is Phase.ARMING
            return [trouble, *(self._refuse(f"{self._refused}{message.text}", stamp) if waited_for else ())]
        return [Stamped(stamp, DeviceText(message.text))]

    def _on_clock(self, boot_us: int, stamp: Stamp) -> list[Output]:
        """Whether it has restarted: its time since power-up goes back, but where its 32 bits overflow."""
        back_us, self._boot_us = self._boot_us - boot_us, boot_us
        overflown = back_us > WRAP_us // 2
        self._overflows += overflown
        if back_us <= RESTART_us or overflown or self._restarted:
            return []
        self._restarted = True
        return self._end("the autopilot has restarted", stamp)

    def _on_servos(self, message: ServoOutput, stamp: Stamp) -> list[Output]:
        # One that came again is no news of pulses; a firmware that gives no time says nothing about that.
        if not self._motors or (message.boot_us > 0 and came_again(self._boot_us, message.boot_us)):
            return []
        self._served_at = stamp
        restarted = self._on_clock(message.boot_us, stamp)
        at = self._clock.map(self._overflows * WRAP_us + message.boot_us, stamp)
        # No pulse at all, as behind a safety switch, is no thrust.
        pulses = tuple(message.pulses_us[one.channel] or CENTER_us for one in self._motors)
        outputs: list[Output] = [*restarted, Stamped(at, AppliedPulses(pulses))]
        resting = all(abs(pulse - CENTER_us) <= PULSE_TOLERANCE_us for pulse in pulses)
        self._watch_rest(stamp, resting=resting)
        if self._by_test and resting:  # what a disarm shows too: no sign of whose thrust it is
            self._moved = False
        elif self._by_test:
            outputs += self._compare(pulses, PULSE_TOLERANCE_us, "pulse", stamp)
        return outputs

    def _watch_rest(self, stamp: Stamp, *, resting: bool) -> None:
        """Whether all thrusters rest, though nothing asked of late did: then neutral, until a heartbeat says why."""
        pushed = [max(abs(one - CENTER_us) for one in asked) for _, asked in self._history]
        self._thrust |= self._phase is Phase.ARMED and not resting
        self._at_rest = self._at_rest + 1 if resting and pushed and min(pushed) > PUSH_us else 0
        if self._thrust and self._at_rest >= MOST_AT_REST and self._rest_at is None:
            self._rest_at = stamp

    def _compare(self, found: tuple[float, ...], tolerance: float, what: str, stamp: Stamp) -> list[Output]:
        """Compare what is there with what was asked lately: what nobody here asked for is another party's."""
        history = self._history
        while len(history) > 1 and seconds_between(history[1][0], stamp) > SEEN_S:
            history.popleft()
        while self._odd and seconds_between(self._odd[0], stamp) > MEMORY_S:
            self._odd.popleft()
        self._moved = any(abs(value - CENTER_us) > tolerance for value in found)
        if self._phase is not Phase.ARMED or not history:
            return []
        for index, (value, *asked) in enumerate(zip(found, *(values for _, values in history), strict=False)):
            if not min(asked) - tolerance <= value <= max(asked) + tolerance:
                self._odd.append(stamp)
                if len(self._odd) >= ODD_LIMIT:
                    asked_us = asked[-1]
                    return self._end(
                        f"another party {TAKEN_OVER}: {what} {index + 1} is at {value:g} us, asked was {asked_us:g}",
                        stamp,
                    )
                break
        return []

    def _watch_beat(self, stamp: Stamp) -> list[Output]:
        """Whether the autopilot is still armed, in the mode that it was put into."""
        beat = self._link.beat
        if seconds_between(self._served_at, stamp) > FRESH_S:
            return self._end("the autopilot has fallen silent", stamp, owned=True)
        if not self._by_test and seconds_between(max(self._sticks_seen_at, self._armed_at), stamp) > MEMORY_S:
            return self._end("it tells its sticks no more (RC_CHANNELS): a pilot's would go unseen", stamp, owned=True)
        if beat is None or self._link.beat_at <= self._armed_at:
            return []
        late = seconds_between(self._armed_at, stamp) > CONFIRMED_S
        self._seen_armed |= beat.armed
        why = self._taken(beat, stamp) if self._seen_armed or late else ""
        return self._end(why, stamp) if why else []

    def _taken(self, beat: Heartbeat, stamp: Stamp) -> str:
        """How a heartbeat shows that it is no more as it was armed from here; empty where it is."""
        if not beat.armed:
            words = self._last_words(stamp) or ", by another party or a failsafe: see its messages"
            return f"the autopilot has been disarmed{words}"
        if beat.mode != MANUAL:
            mode = MODES.get(beat.mode, f"mode {beat.mode}")
            return f"another party, or a failsafe, {TAKEN_OVER}: {mode}{self._last_words(stamp)}"
        rested = self._rest_at is not None and self._link.beat_at > self._rest_at
        return f"another party {TAKEN_OVER}: it has disarmed and armed it" if rested else ""

    def _watch_ourselves(self, stamp: Stamp) -> list[Output]:
        """Whether nothing was sent for so long that the autopilot has gone neutral: no other party has done that."""
        silent_s = self._silent_s(stamp)
        # Delays on the way to it vary: a silence that was a little shorter here may have been as long there.
        if self._phase is not Phase.ARMED or silent_s < self._patience_s - (0.0 if self._by_test else SEEN_S):
            return []
        return self._end(
            f"nothing was sent to the autopilot for {silent_s:.1f} s, and it goes neutral by itself after "
            f"{self._patience_s:g} s; find what has held up this computer",
            stamp,
            owned=True,
        )

    def _silent_s(self, stamp: Stamp) -> float:
        """Time since the last stick or motor test of ours."""
        return seconds_between(max(self._sticks_at, self._tests_at), stamp)

    @property
    def _patience_s(self) -> float:
        """Silence after which the autopilot goes neutral."""
        return TEST_TIMEOUT_S if self._by_test else self._link.parameters.get("FS_PILOT_TIMEOUT", PILOT_TIMEOUT_S)

    def _last_words(self, stamp: Stamp) -> str:
        """What it has said about what is seen now, as far as it has; what it said long before is another matter."""
        recent = self._last_text and seconds_between(self._text_at, stamp) <= WORDS_S
        return f" ({self._last_text})" if recent else ""

    def _end(self, why: str, stamp: Stamp, *, owned: bool = False) -> list[Output]:
        """End for good: a neutral stick, then nothing that could move the vehicle of whoever has it now.

        `owned`: nobody has taken it over; it is disarmed when it answers again.
        """
        if self._phase is Phase.IDLE:
            return []
        self._owned = owned
        farewells = [] if self._by_test else [self._sticks((0.0,) * 6) for _ in range(FAREWELLS)]
        self._phase, self._ended = Phase.IDLE, why
        self._finish_tests(stamp)
        return [*farewells, Trouble(stamp, f"ardusub: {why}"), *(self._take_back(stamp) if owned else ())]

    def _take_back(self, stamp: Stamp) -> list[Output]:
        """Begin to disarm what was out of our reach while armed from here, once a heartbeat has shown who has it."""
        self._phase, self._tries, self._step_at, self._cut_off = Phase.LEAVING, 0, stamp, True
        return []

    def _finish_tests(self, stamp: Stamp) -> None:
        if self._tested:
            self._pause_until = after(stamp, PAUSE_S + 1.0)
        self._tested = False

    # ---- arming and disarming

    def _begin(self, stamp: Stamp) -> list[Output]:
        if self._phase is Phase.LEAVING:
            self._ended = (
                "the autopilot does not arm: it is still armed from before, and is being disarmed; arm again then"
            )
            return [Trouble(stamp, f"ardusub: {self._ended}")]
        beat, self._ended, self._last_text, self._unexplained = self._link.beat, "", "", ""
        busy = [why for name, why in BUSY.items() if self._named.get(name)]
        if beat is not None and beat.armed:
            who = "by another ground station, or from here before a crash"
            return self._refuse(f"it is armed already, {who}; disarm it at a ground station", stamp)
        if busy:
            return self._refuse(f"{busy[0]}; end that at the other ground station", stamp)
        if stamp < self._pause_until:
            left_s = math.ceil(seconds_between(stamp, self._pause_until))
            return self._refuse(f"it needs {left_s} s more of a pause after a motor test; arm again then", stamp)
        self._phase, self._tries, self._seen_armed = Phase.ARMING, 0, False
        self._thrust, self._rest_at = False, None
        self._history.clear()
        self._odd.clear()
        return [*self._stick(stamp), *self._step(stamp)]

    def _refuse(self, why: str, stamp: Stamp) -> list[Output]:
        self._phase, self._ended = Phase.IDLE, f"the autopilot does not arm: {why}"
        return [Trouble(stamp, f"ardusub: does not arm: {why}")]

    def _step(self, stamp: Stamp) -> list[Output]:
        """Ask for the next step: the mode, then arming; or disarming."""
        if self._phase is Phase.LEAVING and not self._may_disarm(stamp):
            return self._stay_away(stamp)
        beat = self._link.beat
        if self._unexplained and self._phase is Phase.ARMING:
            return self._refuse(self._begun[1] or self._unexplained, stamp)
        if self._tries >= ATTEMPTS:
            return self._give_up(stamp)
        self._tries, self._step_at = self._tries + 1, stamp
        if self._phase is Phase.LEAVING:
            return [self._link.command(ARM, 0.0, confirmation=self._tries - 1)]
        if beat is not None and beat.mode != MANUAL:
            return [self._link.command(SET_MODE, 1.0, MANUAL)]
        return [self._link.command(ARM, 1.0, confirmation=self._tries - 1)]

    def _may_disarm(self, stamp: Stamp) -> bool:
        """Whether it is armed, as far as is known, and nobody else's: seen first where it was out of our reach."""
        beat, news = self._link.beat, self._link.beat_at > self._step_at
        if news and beat is not None and not beat.armed:
            return False
        return not self._cut_off or ((news or self._tries > 0) and not self._other_party(stamp))

    def _stay_away(self, stamp: Stamp) -> list[Output]:
        """Whether there is nothing to disarm any more; else a heartbeat must show it."""
        beat = self._link.beat
        if self._link.beat_at <= self._step_at or beat is None:
            return []
        if not beat.armed:
            return self._left(stamp)
        self._phase, self._owned = Phase.IDLE, False
        party = self._other_party(stamp)
        return [Trouble(stamp, f"ardusub: another party has taken over meanwhile: {party}; it is not disarmed")]

    def _left(self, stamp: Stamp) -> list[Output]:
        """It is disarmed."""
        self._phase, self._owned = Phase.IDLE, False
        return [Trouble(stamp, "ardusub: the autopilot is disarmed again")] if self._cut_off else []

    def _other_party(self, stamp: Stamp) -> str:
        """What shows that somebody has it who was not cut off: a mode, or what can be no stick of ours any more."""
        mode = MANUAL if self._link.beat is None else self._link.beat.mode
        if mode != MANUAL:
            return MODES.get(mode, f"mode {mode}")
        late = self._silent_s(stamp) > self._patience_s + SEEN_S
        return f"its {'thrusters' if self._by_test else 'sticks'} are not neutral" if self._moved and late else ""

    def _give_up(self, stamp: Stamp) -> list[Output]:
        beat = self._link.beat
        if self._phase is Phase.LEAVING:
            self._tries = 0  # It is asked as long as it speaks: a vehicle that we armed must not stay so.
            return [Trouble(stamp, "ardusub: does not answer to disarming; asking on")]
        mode = beat is not None and beat.mode != MANUAL
        return self._refuse(f"no answer to {ATTEMPTS} requests {'for MANUAL' if mode else 'to arm'}", stamp)

    def _on_answer(self, answer: CommandAck, stamp: Stamp) -> list[Output]:
        if not self._link.is_ours(answer):
            return []
        if answer.command == MOTOR_TEST:
            return self._on_test(stamp, accepted=answer.result == ACCEPTED)
        if answer.command not in (SET_MODE, ARM) or self._phase not in (Phase.ARMING, Phase.LEAVING):
            return []
        if answer.result == IN_PROGRESS:
            self._step_at = stamp
        elif self._phase is Phase.LEAVING:
            return self._left(stamp) if (answer.command, answer.result) == (ARM, ACCEPTED) else []
        elif answer.result != ACCEPTED:
            self._refused = "MANUAL: " if answer.command == SET_MODE else ""
            if self._last_text:
                return self._refuse(f"{self._refused}{self._last_text}", stamp)
            # ArduSub queues the text that says why behind its answer.
            self._unexplained, self._step_at = f"{self._refused}answered with result {answer.result}", stamp
        elif answer.command == SET_MODE:
            self._tries = 0
        else:
            self._phase, self._owned, self._last_text = Phase.ARMED, True, ""
            self._armed_at = self._accepted_at = stamp
        return []

    def _leave(self, stamp: Stamp) -> list[Output]:
        """Neutral and disarmed, because our own side ends it."""
        outputs: list[Output] = list(self._neutral(stamp))
        self._phase, self._tries, self._cut_off = Phase.LEAVING, 0, False
        self._finish_tests(stamp)
        return [*outputs, *self._step(stamp)]

    # ---- thrust

    def _neutral(self, stamp: Stamp) -> list[Output]:
        tests: list[Output] = list(self._tests((CENTER_us,) * len(self._motors)) if self._tested else ())
        return [*tests, *self._stick(stamp)]

    def _move(self, pulses_us: Sequence[float], stamp: Stamp) -> list[Output]:
        if not self._by_test:
            return self._stick(stamp, pulses_us)
        outputs: list[Output] = []
        wanted = [round(pulse) for pulse in pulses_us]
        if not self._tested:
            self._history.append((stamp, (CENTER_us,) * len(wanted)))
        self._tested = True
        if wanted != self._sent or seconds_between(self._tests_at, stamp) >= REPEAT_S:
            whole = seconds_between(self._tests_at, stamp) >= REPEAT_S or len(self._sent) != len(wanted)
            outputs += self._tests(wanted, () if whole else self._sent)
            self._sent, self._tests_at = wanted, stamp if whole else self._tests_at
            self._history.append((stamp, tuple(map(float, wanted))))
        if seconds_between(self._sticks_at, stamp) >= STICKS_S:
            outputs += self._stick(stamp)
        return outputs

    def _tests(self, pulses_us: Sequence[float], before_us: Sequence[float] = ()) -> list[Send]:
        """One motor test for each pulse that is not as before."""
        by_pulse, board_order, timeout_s = 1.0, 2.0, TEST_TIMEOUT_S
        return [
            self._link.command(MOTOR_TEST, one.number - 1, by_pulse, pulse, timeout_s, 0.0, board_order)
            for index, (one, pulse) in enumerate(zip(self._motors, pulses_us, strict=True))
            if not before_us or before_us[index] != pulse
        ]

    def _on_test(self, stamp: Stamp, *, accepted: bool) -> list[Output]:
        if self._phase is not Phase.ARMED or accepted:
            self._accepted_at = stamp
            self._thrust |= self._phase is Phase.ARMED
            return []
        if self._thrust:  # what has followed refuses where it is disarmed: no more until a heartbeat says why
            self._rest_at = self._rest_at or stamp
            return []
        if seconds_between(self._accepted_at, stamp) < ASK_AGAIN_S:
            return []
        return self._end(f"it refuses motor tests{self._last_words(stamp)}", stamp)

    def _stick(self, stamp: Stamp, pulses_us: Sequence[float] = ()) -> list[Output]:
        """MANUAL_CONTROL nearest to some pulses; neutral without."""
        self._sticks_at = stamp
        if self._mixer is None or not pulses_us:
            if not self._by_test:
                self._history.append((stamp, (CENTER_us,) * 6))
            return [self._sticks((0.0,) * 6)]
        axes = self._mixer.sticks(pulses_us)
        gain = self._gain
        vertical = gain * self._link.parameters.get("JS_THR_GAIN", 1.0)
        most = (gain, gain, min(1.0, vertical), gain, 1.0, 1.0)
        # All alike: the direction of the wrench stays.
        over = max(1.0, *(abs(axis) / limit for axis, limit in zip(axes, most, strict=True)))
        forward, lateral, throttle, yaw, pitch, roll = (axis / over for axis in axes)
        inputs = (pitch, roll, throttle, yaw, forward, lateral)
        self._history.append((stamp, tuple(CENTER_us + HALF_us * one for one in inputs)))
        return [self._sticks((forward, lateral, throttle, yaw, pitch, roll), (gain, gain, vertical, gain, 1.0, 1.0))]

    @property
    def _gain(self) -> float:
        """Gain of the pilot's sticks, which a button of another ground station may change."""
        return min(1.0, max(0.1, self._named.get("PilotGain", self._link.parameters.get("JS_GAIN_DEFAULT", 0.5))))

    def _sticks(self, axes: Sequence[float], gains: Sequence[float] = (1.0,) * 6) -> Send:
        """MANUAL_CONTROL of axes, -1 to 1, which the autopilot multiplies by gains (the last two of them by none).

        It cuts what it gets to whole microseconds: the middle between two of them arrives as it was meant.
        """
        whole = [round(HALF_us * axis) for axis in axes]
        parts = [(one + 0.5 * bool(one)) / (HALF_us * gain) for one, gain in zip(whole, gains, strict=True)]
        x, y, z, r = (max(-1000, min(1000, round(1e3 * one))) for one in parts[:4])
        sticks = (x, y, 500 + z // 2, r, whole[4], whole[5])
        return self._link.send(ardupilot.manual_control(sticks, self._link.system))


def _has_six_axes(version: Version) -> bool:
    """Whether MANUAL_CONTROL of a release has pitch and roll: what 4.5 began with was put into 4.1 as well."""
    return version.firmware >= SIX_AXES or SIX_AXES_OF_4_1 <= version.firmware < AFTER_4_1
