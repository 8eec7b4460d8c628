"""Drawing the live view: one function per section, from values to styled text that fits 38 or 78 columns."""

import math
from collections.abc import Callable, Mapping

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hindrax_control.hold.holds import HoldState
from hindrax_core.signals import Estimate, Navigation
from hindrax_core.text.digits import TWO_SIDED_95, rounded
from hindrax_operator.progress import units
from hindrax_operator.snapshot import ANGLES, ManeuverView, NodeHealth, Snapshot, Thrusters

GOOD, WARN, BAD, DIM, VALUE = "green", "yellow", "bold red", "grey58", "bold"
SILENT_S = 2.0
ENDED_DISARMED = "ended, disarmed before; its last values stand below"
ENDED_ARMED = "no program left to stop it: if it thrusts, cut the power"
"""What is known of a vehicle whose programs are all gone: by the last state of its thrusters."""
FULL_us = 400.0
"""Half the span of the pulses: a full bar."""
BAR, PROGRESS = 8, 28
"""Cells of half a thruster's bar, and of a maneuver's."""
LEVEL_STYLES = {"ok": GOOD, "warning": WARN, "error": BAD, "stale": BAD}
SHORT_NAMES = {"added_mass": "m_a"}


def headline(view: Snapshot, title: str) -> Text:
    """Armed or not, before everything else; then who and when."""
    thrusters = view.thrusters
    if view.silent_s > SILENT_S:
        if math.isinf(view.silent_s):  # nothing has ended that was never seen
            return Text.assemble((" no message yet ", "bold white on red"), "  ", (title, DIM))
        silent = f"no message for {view.silent_s:.0f} s"
        hint = "" if view.stoppable else f"  {ENDED_DISARMED if thrusters.state == 'disarmed' else ENDED_ARMED}"
        return Text.assemble((f" {silent} ", "bold white on red"), hint, "  ", (title, DIM))
    color = "bold white on red" if thrusters.armed else "bold black on green"
    word = thrusters.state.upper() if thrusters.armed or thrusters.state == "disarmed" else thrusters.state
    style = color if thrusters.armed or thrusters.state == "disarmed" else "bold black on yellow"
    reason = f"  {thrusters.reason}" if thrusters.reason and thrusters.state != "disarmed" else ""
    return Text.assemble((f" {word} ", style), reason, "  ", (title, DIM), (f"  {view.time_s:.0f} s", DIM))


def state(navigation: Navigation | None) -> RenderableType:
    """Attitude, depth, velocity, position."""
    if navigation is None:
        return Text("no navigation solution yet;\nsee the health of the sensors", style=WARN)
    roll, pitch, heading = (math.degrees(angle) for angle in navigation.attitude_rad)
    north, east = navigation.position_m
    table = _grid(11, 0)
    lost = Text("no bottom lock", style=BAD)
    if not all(map(math.isfinite, navigation.velocity_mps[:2])):
        lost = Text("no velocity", style=WARN)  # on board is none, or it has not measured any since the start
    locked = Text("locked", style=GOOD) if navigation.dvl_locked else lost
    for name, value in (
        ("heading", _numbers((heading % 360.0,), ".1f", "deg")),
        ("roll, pitch", _numbers((roll, pitch), "+z.1f", "deg")),
        ("depth", _numbers((navigation.depth_m,), ".2f", "m")),
        ("altitude", _numbers((navigation.altitude_m,), ".2f", "m")),
        ("surge, sway", _numbers(navigation.velocity_mps[:2], "+z.3f", "m/s")),
        ("heave", _numbers((navigation.velocity_mps[2],), "+z.3f", "m/s")),
        ("north, east", _numbers((north, east), "+z.2f", "m")),
        ("DVL", locked),
    ):
        table.add_row(Text(name, style=DIM), value)
    return table


def holds(found: tuple[HoldState, ...]) -> RenderableType:
    """Every hold with setpoint and error, or off."""
    if not found:
        return Text("no message from the pilot yet", style=DIM)
    table = _grid(8, 12, 0)
    for hold in found:
        place = Text(f"at {_amount(hold.axis, hold.setpoint)}", style=GOOD) if hold.engaged else Text("off", style=DIM)
        off = f"off by {_amount(hold.axis, hold.error, '+')}" if hold.engaged and not hold.note else ""
        table.add_row(Text(hold.axis, style=VALUE if hold.engaged else DIM), place, Text(off, style=DIM))
    # In full and below: a refusal is longer than a column.
    return Group(table, *(Text(f"{hold.axis}: {hold.note}", style=WARN) for hold in found if hold.note))


def thrusters(found: Thrusters) -> RenderableType:
    """One bar per thruster around neutral, with pulse and force."""
    if not found.names:
        return Text("no message from the thrusters yet", style=DIM)
    table = _grid(2, 2 * BAR + 1, 7, 0)
    rows = zip(found.names, found.pulses_us, found.stops_us, found.forces_N, found.saturated, strict=True)
    for name, pulse, stop, force, saturated in rows:
        if name in found.disabled:
            table.add_row(Text(name, style=BAD), Text("disabled", style=BAD), "", "")
            continue
        color = BAD if saturated else "cyan"
        table.add_row(
            Text(name, style=VALUE),
            _bar((pulse - stop) / FULL_us, color),
            Text(f"{pulse:4.0f} us", style=DIM),
            _numbers((force,), "+z5.1f", "N"),
        )
    return table


def lost(found: Thrusters) -> str:
    """Axes that the thrusters in use cannot serve, for the title."""
    return f", lost: {', '.join(found.lost_axes)}" if found.lost_axes else ""


def health(found: Mapping[str, NodeHealth]) -> RenderableType:
    """Unhealthy nodes first, with their text; healthy ones in two columns, with their rates."""
    if not found:
        return Text("no /diagnostics yet", style=DIM)
    ill = {name: one for name, one in found.items() if one.level != "ok"}
    lines = [
        Text.assemble(("● ", LEVEL_STYLES[one.level]), (name, VALUE), f" {one.message}") for name, one in ill.items()
    ]
    well = [_well(name, one) for name, one in found.items() if one.level == "ok"]
    table = _grid(16, 0)
    for left in range(0, len(well), 2):
        table.add_row(*well[left : left + 2])
    return Group(*lines, table)


def _well(name: str, one: NodeHealth) -> Text:
    rate = "" if math.isnan(one.rate_Hz) else f" {one.rate_Hz:.0f} Hz"
    return Text.assemble(("● ", GOOD), name, (rate, DIM))


def maneuver(flight: ManeuverView | None) -> RenderableType:
    """Progress of what is being flown, or how the last one ended."""
    if flight is None:
        return Text("none; ./hindrax pool-test flies them", style=DIM)
    if flight.aborted:
        return Text(f"{flight.motion} aborted by {flight.aborted}".lstrip(), style=BAD)
    if flight.phase == "done":
        return Text("done", style=GOOD)
    done = round(PROGRESS * min(1.0, max(0.0, flight.progress)))
    first = Text.assemble(
        ("━" * done, "cyan"),
        ("━" * (PROGRESS - done), "grey27"),
        f" {100.0 * flight.progress:3.0f} %  ",
        (f"{flight.motion} {flight.phase}", VALUE),
        (f"  {_time(flight.remaining_s)} to go", DIM),
    )
    unit, rate = units(flight.motion)
    wall = "" if math.isnan(flight.wall_m) else f", wall {flight.wall_m:.1f} m ahead"
    second = Text(f"{flight.force:+z.1f} {unit}, {flight.velocity:+z.3f} {rate}{wall}", style=DIM)
    return Group(first, second)


def estimates(found: Mapping[str, Estimate]) -> RenderableType:
    """Each motion: a dot while it learns, coefficients with deviations, then its samples or why it does not learn."""
    if not found:
        return Text("none yet; they come with the first plateau of a maneuver", style=DIM)
    width = max(len(motion) for motion in found)
    return Group(*(_estimate(motion.ljust(width), one) for motion, one in found.items()))


def _estimate(motion: str, one: Estimate) -> Text:
    text = Text().append(f"{motion} ", VALUE)
    text.append("● " if one.learning else "○ ", GOOD if one.learning else DIM)
    if not one.samples:
        return text.append(f"nothing learned yet {one.reason}".rstrip(), DIM)
    for name, value, sigma in zip(one.names, one.values, one.sigmas, strict=True):
        band = TWO_SIDED_95 * sigma
        style = GOOD if band < 0.1 * abs(value) else WARN if band < abs(value) else DIM
        short = SHORT_NAMES.get(name, name)
        number, plus_minus = rounded(value, sigma) if math.isfinite(value) and math.isfinite(sigma) else ("?", "?")
        text.append(f"{short} ", DIM).append(number, VALUE).append(f"\u00b1{plus_minus} ", style)
    return text.append(f"{one.samples} {one.reason}".rstrip(), DIM)


def _bar(part: float, color: str) -> Text:
    """Bar to the left or to the right of a middle line; halves of a cell show small pulses."""
    halves = round(2 * BAR * min(1.0, abs(part)))
    full, half = divmod(halves, 2)
    if part < 0.0:
        left = ("▐" if half else "") + "█" * full
        return Text.assemble((left.rjust(BAR), color), ("│", DIM), " " * BAR)
    right = "█" * full + ("▌" if half else "")
    return Text.assemble(" " * BAR, ("│", DIM), (right.ljust(BAR), color))


def _grid(*least: int) -> Table:
    """Columns that are at least so wide; the last one gives way when there is not enough room."""
    table = Table.grid(padding=(0, 1, 0, 0))
    for width in least:
        table.add_column(no_wrap=bool(width), min_width=width or None)  # the free one gives way
    return table


def _numbers(values: tuple[float, ...], form: str, unit: str) -> Text:
    if not all(math.isfinite(value) for value in values):
        return Text("unknown", style=WARN)
    return Text.assemble(("  ".join(format(value, form) for value in values), VALUE), (f" {unit}", DIM))


def _amount(axis: str, value: float, sign: str = "") -> str:
    if not math.isfinite(value):
        return "?"
    if axis not in ANGLES:
        return f"{value:{sign}z.2f} m"
    degrees = math.degrees(value)
    return f"{degrees % 360.0 if axis == 'heading' and not sign else degrees:{sign}z.1f} deg"


def _time(seconds: float) -> str:
    if not math.isfinite(seconds):
        return "?"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


Section = Callable[[Snapshot], RenderableType]

SECTIONS: Mapping[str, Section] = {
    "state": lambda view: state(view.navigation),
    "thrusters": lambda view: thrusters(view.thrusters),
    "holds": lambda view: holds(view.holds),
    "health": lambda view: health(view.health),
    "maneuver": lambda view: maneuver(view.flight),
    "estimates": lambda view: estimates(view.estimates),
}
"""The sections by the name of their place."""
