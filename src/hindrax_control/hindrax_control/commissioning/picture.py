"""A picture of a commissioning: every thruster as the file has it, and as its pulses showed it, from two sides."""

import html
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hindrax_control.commissioning.findings import OPEN, PROVEN, WRONG, Findings
from hindrax_core.vehicle import Thruster, Vehicle

WIDTH, HEIGHT, SPAN_px = 900, 460, 300.0
CLAIMED, FOUND, BAD, NONE = "#9aa5b1", "#1f7a4d", "#c62828", "#b26a00"
LEGEND = ((CLAIMED, "claimed"), (FOUND, "found as claimed"), (BAD, "found otherwise"), (NONE, "not shown"))
ARROW_px = 62.0
SHORTEST_px = 3.0
MOST_LINES = 3


@dataclass(frozen=True, slots=True)
class View:
    """A projection: title, middle and scale on the page, axes of the body to the right and down, and their signs."""

    title: str
    middle_px: tuple[float, float]
    axes: tuple[int, int]
    signs: tuple[float, float]
    scale: float = 1.0

    def flat(self, vector: Sequence[float]) -> tuple[float, float]:
        """Components of a body vector to the right and down."""
        right, down = (sign * vector[axis] for axis, sign in zip(self.axes, self.signs, strict=True))
        return right, down

    def place(self, position_m: Sequence[float]) -> tuple[float, float]:
        """Point on the page."""
        right, down = self.flat(position_m)
        return self.middle_px[0] + right * self.scale, self.middle_px[1] + down * self.scale


def svg(vehicle: Vehicle, findings: Findings) -> str:
    """SVG of a vehicle in two views: grey as claimed, green as claimed and found, red where they differ."""
    scale = SPAN_px / max(vehicle.envelope_m)
    views = (
        View("from above, the bow up", (230.0, 220.0), (1, 0), (1.0, -1.0), scale),
        View("from starboard, the bow to the right", (660.0, 220.0), (0, 2), (1.0, 1.0), scale),
    )
    verdicts = {row.claim: row.verdict for row in findings.rows}
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    for view in views:
        lines += _hull(vehicle, view)
        for thruster in vehicle.thrusters:
            wrench = findings.wrenches.get(thruster.name)
            lines += _thruster(view, thruster, wrench, verdicts.get(thruster.name, OPEN))
    lines += _quantities(findings)
    for at, (color, words) in enumerate(LEGEND):
        x = 40 + 190 * at
        lines.append(f'<rect x="{x}" y="{HEIGHT - 28}" width="14" height="14" fill="{color}"/>')
        lines.append(f'<text x="{x + 20}" y="{HEIGHT - 16}" font-size="13">{words}</text>')
    return "\n".join([*lines, "</svg>"])


def _quantities(findings: Findings) -> Iterator[str]:
    """Lines of what has no place on the vehicle: dead bands and supply, claimed and found."""
    rows = [row for row in findings.rows if row.claim.startswith(("dead band", "supply"))]
    for at, row in enumerate(rows[:MOST_LINES]):
        color = BAD if row.verdict == WRONG else FOUND if row.verdict == PROVEN else CLAIMED
        text = html.escape(f"{row.claim}: claimed {row.claimed}, {row.found}")
        yield f'<text x="40" y="{HEIGHT - 44 - 16 * at}" font-size="12" fill="{color}">{text}</text>'


def _hull(vehicle: Vehicle, view: View) -> Iterator[str]:
    wide, high = (vehicle.envelope_m[axis] * view.scale for axis in view.axes)
    x, y = view.middle_px
    title = f"{html.escape(vehicle.name)}, {view.title}"
    yield f'<text x="{x:.0f}" y="24" font-size="14" text-anchor="middle">{title}</text>'
    box = f'x="{x - wide / 2:.1f}" y="{y - high / 2:.1f}" width="{wide:.1f}" height="{high:.1f}"'
    yield f'<rect {box} fill="none" stroke="{CLAIMED}"/>'


def _thruster(view: View, thruster: Thruster, found: Sequence[float] | None, verdict: str) -> Iterator[str]:
    """Name at its place, the claimed direction in grey, the direction of the measured force in its color."""
    place = x, y = view.place(thruster.position_m)
    color = BAD if verdict == WRONG else NONE if verdict == OPEN else FOUND
    yield _arrow(place, view.flat(thruster.direction), CLAIMED, 7.0)
    if found is not None:
        yield _arrow(place, view.flat(found), color, 3.0)
    yield f'<text x="{x + 6:.1f}" y="{y - 6:.1f}" font-size="13" fill="{color}">{html.escape(thruster.name)}</text>'


def _arrow(place: tuple[float, float], force: tuple[float, float], color: str, width: float) -> str:
    """An arrow with a dot at its head; a ring where the force is along the line of sight."""
    x, y = place
    right, down = (ARROW_px * part for part in force)
    if abs(right) + abs(down) < SHORTEST_px:
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{width}" fill="none" stroke="{color}" stroke-width="2"/>'
    end_x, end_y = x + right, y + down
    line = (
        f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{end_x:.1f}" y2="{end_y:.1f}" stroke="{color}" stroke-width="{width}"/>'
    )
    return f'{line}<circle cx="{end_x:.1f}" cy="{end_y:.1f}" r="{width}" fill="{color}"/>'
