"""Manual orders of an operator: holds, wrenches, thrusters out of use, one thruster alone, stop.

The vehicle checks every order. These functions only report in advance what it would refuse, and wait for the outcome.
A wrench and the pulses of a single thruster expire on board half a second after their stamps; holds stay.
"""

import math
from collections.abc import Callable, Mapping, Sequence

from std_msgs.msg import Float32MultiArray

from hindrax_control.hold.holds import HoldState
from hindrax_control.maneuver.goal import unobeyed
from hindrax_core.errors import HindraxError
from hindrax_core.events import after
from hindrax_core.readings import Vec6
from hindrax_core.rotation import wrapped
from hindrax_core.signals import ZERO6
from hindrax_core.text.refusals import received, state_and_reason
from hindrax_core.topics import HOLD_SETPOINT, LIGHTS, OPERATOR_WRENCH, THRUSTER_COMMAND, THRUSTER_HEALTH_ORDER
from hindrax_msgs.msg import (
    AllocationStatus,
    HoldSetpoint,
    HoldStatus,
    ThrusterCommand,
    ThrusterHealth,
    ThrusterState,
)
from hindrax_msgs.srv import Recentre
from hindrax_operator.nodes.operator_node import ANSWER_S, UP, Operator
from hindrax_operator.snapshot import ANGLES, holds_of
from hindrax_ros.messages.convert import stamp_from_msg, stamp_to_msg, wrench_to_msg

WRENCH_PERIOD_S = 0.1
COMMAND_PERIOD_S = 0.05
AGAIN_S = 0.5
ANSWERED_S = 0.8
"""Time after which the pilot has received an order and reported its outcome."""
REFUSED = "refused: "
KEPT_S = 1.0
"""Time in which the safety monitor sends its list of thrusters out of use to a restarted pilot."""
SLOWEST_PACE = 0.2
"""A mock that is slower than this against the wall clock is given up."""
SETPOINT_TOLERANCE = 1e-6
LIGHTS_PERIOD_S = 0.3


def stop(operator: Operator) -> list[str]:
    """Disarm (neutral at once, holds released), then cancel whatever flies; returns a sentence for what failed."""
    failed: list[str] = []
    acts: tuple[Callable[[], object], ...] = (lambda: operator.arm(arm=False, seconds=ANSWER_S), operator.cancel_all)
    for act in acts:
        try:
            act()
        except HindraxError as error:
            failed.append(str(error))
    return failed


def awaited_thrusters(operator: Operator) -> ThrusterState:
    """State of the thrusters; HindraxError where no stack tells it, with the command that starts one."""
    return operator.awaited(lambda: operator.thrusters, ANSWER_S, lambda: f"the thrusters; {UP}")


def require_armed(operator: Operator) -> None:
    """HindraxError unless the thrusters are armed and nothing is being flown."""
    found = awaited_thrusters(operator)
    if not found.armed:
        now = state_and_reason(found.state, found.reason)
        raise HindraxError(f"the thrusters are {now}, wanted armed; `./hindrax arm` first")
    operator.pause(0.3)
    require_obedience(operator)
    if operator.flying:
        raise HindraxError(f"a maneuver is being flown ({operator.flying}); `./hindrax stop` ends it")


def require_obedience(operator: Operator) -> None:
    """HindraxError while armed thrusters follow no command: nothing would be held or pushed."""
    if operator.unobeyed:
        raise HindraxError(unobeyed(operator.unobeyed))


def hold(operator: Operator, axes: Sequence[str], value: float, *, engaged: bool) -> dict[str, float]:
    """Engage (NaN: where the vehicle is), move or release holds; returns the setpoints in force. Radians and meters."""
    if engaged:
        require_armed(operator)
    with operator.sender(HOLD_SETPOINT, "the pilot, which serves the holds") as send:
        for axis in axes:
            _send_until_held(operator, send, HoldSetpoint(axis=axis, engaged=engaged, value=value))
    found = {one.axis: one.setpoint for one in holds_of(operator.holds)}
    return {axis: found[axis] for axis in axes} if engaged else {}


def _send_until_held(operator: Operator, send: Callable[[HoldSetpoint], None], wanted: HoldSetpoint) -> None:
    """Repeat a setpoint until the pilot reports it: the first matched reader may have been the recorder."""
    started = operator.now()

    def publish() -> None:
        wanted.sequence = operator.next()
        wanted.header.stamp = stamp_to_msg(operator.now())
        send(wanted)

    def held() -> bool:
        if wanted.engaged:
            require_obedience(operator)
        # Before, the pilot may not have received it: a refusal would belong to another setpoint.
        answered = operator.holds is not None and stamp_from_msg(operator.holds.header.stamp) >= after(
            started, ANSWERED_S
        )
        found = _hold(operator.holds, wanted.axis)
        if answered and found and (refused := found.note.partition(REFUSED)[2]):
            raise HindraxError(refused)
        return _holds_as(operator.holds, wanted)

    verb = "engage" if wanted.engaged else "end"
    with operator.repeating(AGAIN_S, publish):
        operator.wait(held, ANSWER_S, lambda: f"the {wanted.axis} hold to {verb}{_note(operator.holds, wanted.axis)}")


def _hold(status: HoldStatus | None, axis: str) -> HoldState | None:
    return next((one for one in holds_of(status) if one.axis == axis), None)


def _holds_as(status: HoldStatus | None, wanted: HoldSetpoint) -> bool:
    if (found := _hold(status, wanted.axis)) is None:
        return False
    if not (found.engaged and wanted.engaged):
        return found.engaged == wanted.engaged
    if math.isnan(wanted.value):
        return math.isfinite(found.setpoint)
    off = found.setpoint - wanted.value
    return abs(wrapped(off) if wanted.axis in ANGLES else off) < SETPOINT_TOLERANCE


def _note(status: HoldStatus | None, axis: str) -> str:
    if (found := _hold(status, axis)) is None:
        return "; the pilot does not answer: it waits for a navigation solution (`./hindrax monitor`)"
    if found.note:
        return f"; it says: {found.note}"
    return "; the pilot gives no reason: does another client set this hold? Try again"


def recentre(operator: Operator, x_m: float, y_m: float, turned_rad: float) -> None:
    """Tell the pilot where in the pool the vehicle is now; HindraxError with its reason if it does not take it."""
    client = operator.node.create_client(Recentre, "maneuver/recentre")
    try:
        operator.wait(client.service_is_ready, ANSWER_S, lambda: f"the pilot to offer maneuver/recentre; {UP}")
        turned = not math.isnan(turned_rad)
        stamp = operator.order_stamp()
        request = Recentre.Request(x=x_m, y=y_m, set_heading=turned, turned=turned_rad, stamp=stamp)
        future = client.call_async(request)
        operator.wait(future.done, ANSWER_S, lambda: "an answer from maneuver/recentre")
    finally:
        operator.node.destroy_client(client)
    answer: Recentre.Response = future.result()
    if not answer.accepted:
        raise HindraxError(received(answer.error_code, answer.reason).within("recentre: "))


def apply_wrench(operator: Operator, wrench: Vec6, seconds: float) -> AllocationStatus:
    """Command a wrench [N, N m] for a span of vehicle time; returns the last allocation, ends with a zero wrench."""
    operator.awaited(lambda: operator.allocation, ANSWER_S, lambda: f"the allocator; {UP}")
    with operator.sender(OPERATOR_WRENCH, "the pilot, which accepts operator wrenches") as send:
        end = after(operator.now(), seconds)
        try:
            with operator.repeating(WRENCH_PERIOD_S, lambda: send(wrench_to_msg(operator.now(), wrench))):
                until(operator, lambda: operator.now() >= end, seconds, "the wrench")
            return operator.awaited(lambda: operator.allocation, 0.0, lambda: "the allocation")
        finally:
            send(wrench_to_msg(operator.now(), ZERO6))


def until(operator: Operator, over: Callable[[], bool], seconds: float, what: str) -> None:
    """Spin until it is over, about `seconds` of vehicle time; HindraxError when the thrusters are disarmed before."""
    done = while_armed(operator, over, what)
    operator.wait(done, seconds / SLOWEST_PACE + ANSWER_S, lambda: f"{what} to end; the clock has stopped")


def while_armed(operator: Operator, over: Callable[[], bool], what: str) -> Callable[[], bool]:
    """Whether it is over; HindraxError with the state of the thrusters and its reason once they are not armed."""

    def done() -> bool:
        if not operator.armed:
            now = operator.thrusters
            state = "silent" if now is None else state_and_reason(now.state, now.reason)
            raise HindraxError(f"{what} ended early: the thrusters are {state}")
        require_obedience(operator)
        return over()

    return done


def set_health(operator: Operator, names: set[str], reason: str, *, usable: bool) -> list[str]:
    """Take thrusters into use or out of it; returns all that are out, as the allocator has it, with their reasons."""
    listed = _list_in_force(operator)
    known_names = operator.awaited(lambda: operator.allocation, ANSWER_S, lambda: "the allocator").thrusters
    unknown = sorted(names - set(known_names))
    if unknown:
        known = ", ".join(known_names)
        raise HindraxError(f"found no thruster {', '.join(unknown)}; the vehicle has {known}")
    wanted = sorted(set(listed.disabled) - names if usable else names.union(listed.disabled))
    kept: Mapping[str, str] = dict(zip(listed.disabled, listed.reasons, strict=False))
    message = ThrusterHealth(disabled=wanted, reasons=[kept.get(name, reason) for name in wanted])
    # Later than the list in force, whatever the clock did since: the pilot takes nothing older.
    message.header.stamp = stamp_to_msg(max(operator.now(), stamp_from_msg(listed.header.stamp) + 1))
    with (
        operator.sender(THRUSTER_HEALTH_ORDER, "the pilot, which owns the list of disabled thrusters") as send,
        operator.repeating(AGAIN_S, lambda: send(message)),
    ):
        operator.wait(
            lambda: all(
                one is not None and sorted(one.disabled) == wanted for one in (operator.health, operator.allocation)
            ),
            ANSWER_S,
            lambda: "the allocator to take the list",
        )
    return wanted


def _list_in_force(operator: Operator) -> ThrusterHealth:
    """Return the pilot's list; after a restart of the pilot, wait until the safety monitor has sent the list again."""
    operator.awaited(lambda: operator.allocation, ANSWER_S, lambda: f"the allocator and the pilot; {UP}")
    found = operator.awaited(lambda: operator.health, ANSWER_S, lambda: f"the allocator and the pilot; {UP}")
    if stamp_from_msg(found.header.stamp) == 0:
        operator.pause(KEPT_S)
    return operator.health or found


def require_sole(operator: Operator) -> None:
    """HindraxError when another node commands the thrusters: two masters would fight, and neither could be trusted."""
    operator.pause(1.0)
    if operator.node.count_publishers(THRUSTER_COMMAND.name):
        raise HindraxError(
            "the control process commands the thrusters, and a thruster alone needs them for itself; "
            "end the stack first, or push with `./hindrax wrench`"
        )


def run_alone(operator: Operator, pulses_us: Sequence[float], seconds: float) -> ThrusterState:
    """Command pulses for a span of vehicle time as the only master; returns the last thruster state of the span."""
    with operator.sender(THRUSTER_COMMAND, "the thrusters") as send:

        def command(pulses: Sequence[float]) -> None:
            message = ThrusterCommand(sequence=operator.next(), pulses=list(pulses))
            message.header.stamp = stamp_to_msg(operator.now())
            send(message)

        with operator.repeating(COMMAND_PERIOD_S, lambda: command(pulses_us)):
            # Armed for a while without a command, they say that they obey none: until the first one has arrived.
            operator.wait(
                lambda: not operator.unobeyed, ANSWER_S, lambda: f"a command to be obeyed: {operator.unobeyed}"
            )
            end = after(operator.now(), seconds)
            until(operator, lambda: operator.now() >= end, seconds, "the thruster's run")
        return operator.awaited(lambda: operator.thrusters, ANSWER_S, lambda: "the thrusters")


def set_lights(operator: Operator, levels: Sequence[float]) -> None:
    """Publish the brightness of each lamp, 0 to 1, three times: the lamps do not answer."""
    message = Float32MultiArray(data=levels)
    with operator.sender(LIGHTS, "the thrusters, which have the lamps") as send:
        for _ in range(3):
            send(message)
            operator.pause(LIGHTS_PERIOD_S)
