"""Progress of a maneuver on stderr: a live view on a terminal, else one line per phase."""

from __future__ import annotations

import contextlib
import math
import sys
import time
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.live import Live
from rich.table import Table

from hindrax_control.maneuver.plan import TURNING
from hindrax_core.events import Stamped
from hindrax_core.signals import Estimate, Navigation
from hindrax_core.text.digits import IN_FLIGHT, measured
from hindrax_core.text.screen_text import fitted, screen_width

if TYPE_CHECKING:
    from hindrax_msgs.msg import ManeuverStatus

REFRESH_S = 0.2


class Progress:
    """Shows `ManeuverStatus` messages and estimates on stderr; use it as a context manager."""

    def __init__(self, *, headless: bool) -> None:
        self._console = Console(stderr=True)
        live = not headless and sys.stderr.isatty()
        self._live = Live(console=self._console, auto_refresh=False, transient=True) if live else None
        self._begin = time.monotonic()
        self._shown = 0.0
        self._phase = ("", "")
        self._named = False

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.end_view()

    def end_view(self) -> None:
        """Take the live view away: what it shows is over. Lines can still be reported."""
        if self._live is not None:
            self._live.stop()

    def report(self, text: str) -> None:
        """Print one line with the wall time since the start."""
        line = f"[{time.monotonic() - self._begin:5.1f} s] {text}"
        text = fitted(line, screen_width(sys.stderr))
        with contextlib.suppress(OSError):  # as for all output on stderr
            self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def show(
        self,
        maneuver: ManeuverStatus | None,
        navigation: Stamped[Navigation] | None,
        estimates: dict[str, Stamped[Estimate]],
    ) -> None:
        """Show the state of the maneuver, at most five times a second.

        Parameters
        ----------
        maneuver
            Last status; None before the first, and then nothing is shown.
        navigation
            Last state of the vehicle; None before the first.
        estimates
            Last estimate of each motion, by its name.
        """
        if maneuver is None or time.monotonic() - self._shown < REFRESH_S:
            return
        self._shown = time.monotonic()
        if self._live is not None:
            self._live.update(panel(maneuver, navigation, estimates), refresh=True)
            return
        phase = (maneuver.motion, maneuver.phase)
        if phase != self._phase:
            self._phase = phase
            if maneuver.phase == "plateau":
                if not self._named and maneuver.motion in estimates:
                    self._named = True
                    self.report(IN_FLIGHT)
                self.report(plateau_line(maneuver, estimates))


def panel(
    maneuver: ManeuverStatus, navigation: Stamped[Navigation] | None, estimates: dict[str, Stamped[Estimate]]
) -> Table:
    """Make the live view: maneuver, vehicle, estimates so far.

    Parameters
    ----------
    maneuver
        Its motion, phase, force, velocity and remaining time.
    navigation
        State of the vehicle; None: its row is left out.
    estimates
        By motion, a row each.

    Returns
    -------
    Table
        For `rich`.
    """
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    done = round(20 * min(1.0, max(0.0, maneuver.progress)))
    bar = "#" * done + "." * (20 - done)
    table.add_row("maneuver", f"{bar} {100.0 * maneuver.progress:3.0f} %  {maneuver.motion} {maneuver.phase}")
    unit, rate = units(maneuver.motion)
    now = f"{maneuver.force:+z.1f} {unit}, {maneuver.velocity:+z.3f} {rate}{wall(maneuver)}"
    table.add_row("", f"{now}, {maneuver.remaining:.0f} s of vehicle time to go")
    if navigation is not None:
        state = navigation.reading
        heading = math.degrees(state.attitude_rad[2])
        where = f"altitude {state.altitude_m:.2f} m, depth {state.depth_m:.2f} m, heading {heading:z.0f} deg"
        table.add_row("vehicle", where)
    for motion, stamped in estimates.items():
        table.add_row(motion, coefficients_line(stamped.reading))
    if estimates:
        table.add_row("", IN_FLIGHT)
    return table


def plateau_line(maneuver: ManeuverStatus, estimates: dict[str, Stamped[Estimate]]) -> str:
    """One line for a plateau that begins: where the maneuver is, and what is known of this motion by now."""
    line = f"{maneuver.motion}: plateau at {maneuver.force:+z.1f} {units(maneuver.motion)[0]}"
    line += f", {100.0 * maneuver.progress:.0f} %, {maneuver.remaining:.0f} s to go{wall(maneuver)}"
    known = estimates.get(maneuver.motion)
    return f"{line}; {coefficients_line(known.reading)}" if known else line


def units(motion: str) -> tuple[str, str]:
    """Units of the force and of the rate along a motion."""
    return ("N m", "rad/s") if motion in TURNING else ("N", "m/s")


def wall(maneuver: ManeuverStatus) -> str:
    """Distance to the wall ahead, where known."""
    return "" if math.isnan(maneuver.wall_distance) else f", wall {maneuver.wall_distance:.1f} m ahead"


def coefficients_line(estimate: Estimate) -> str:
    """Values with standard deviations and units, and whether it learns; before its first sample only that."""
    if not estimate.samples:
        return f"nothing learned yet{estimate.reason and f': {estimate.reason}'}"
    rows = zip(estimate.names, estimate.values, estimate.sigmas, estimate.units, strict=True)
    values = "  ".join(f"{name} {measured(value, sigma)} {unit}" for name, value, sigma, unit in rows)
    state = f"{estimate.samples} samples" if estimate.learning else f"not learning: {estimate.reason}"
    return f"{values}  ({state})"
