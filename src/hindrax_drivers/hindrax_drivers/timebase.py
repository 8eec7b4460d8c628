"""From a device's own clock to ROS time: a minimum-delay filter with bounded drift.

A sample arrives later than it was taken, by a delay that is never negative and changes from sample to sample
(scheduling, batching, a busy wire). The device's ticks do not suffer from that, but their rate is off by some ppm. So
the time of a sample is read from the straight line under the points (ticks, arrival): its slope is that of the
lower convex hull over the last minute, its height that of the least delayed sample of the last 24 s
(Moon, Skelly and Towsley, "Estimation and removal of clock skew from network delay measurements", INFOCOM 1999).
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, TypeAlias

from hindrax_core.events import NS_PER_S, Stamp

BreakKind: TypeAlias = Literal["reset", "jump", "host step"]
Point: TypeAlias = tuple[float, float]
"""Device time and delay against the nominal clock, both in ns from the last (re)start."""


JUMP_ns = 0.25 * NS_PER_S
"""Step ahead of the device's clock that is taken for a jump."""
LOST_ns = 0.1 * NS_PER_S
"""Lateness of every sample of a second that is time lost by the device. Commands older than 0.2 s are not obeyed."""
FOLLOWED_ns = 2.0 * NS_PER_S
"""Lost time that stamps catch up with at twice the pace: one step would be a gap where no sample is missing."""
BLOCK_ns = 2.0 * NS_PER_S
"""Span of which the least delayed sample is kept."""
SLOPE_BLOCKS, HEIGHT_BLOCKS = 32, 12
"""Newest blocks that fix the rate, and the offset."""


@dataclass(frozen=True, slots=True)
class Break:
    """The device's clock (or the host's) did not run steadily.

    `reset`: it went back; `jump`: it jumped, `shift_s` ahead of the expected time; `host step`: arrivals went back in
    time. Then the map restarts.
    """

    kind: BreakKind
    shift_s: float
    ticks: int
    arrival: Stamp


RESTART_us = 1_000_000
"""Step back of a device's time beyond which its clock has begun anew, or was set."""


def came_again(newest_us: int, found_us: int) -> bool:
    """Whether a message is no newer than the last of its kind, but not of a clock that has begun anew.

    It came again or out of order, as from a link that is stuck on its last batch: each of its messages then differs
    from the one before it.

    Parameters
    ----------
    newest_us, found_us : [us]
        By the device's clock: of the last message of its kind, and of this one.

    Returns
    -------
    bool
        True for an equal time too.
    """
    return 0 <= newest_us - found_us <= RESTART_us


class Timebase:
    """Maps device ticks to ROS time; one per device clock.

    `tick_s` is the nominal length of a tick, `drift_ppm` the largest accepted error of its rate, `latency_s` the delay
    that every sample has. `on_break` is called with each Break, from inside `map`, before it returns. `even_s`: where
    the arrival is a look at the clock before the sample is fetched, a process that waits for the processor in between
    makes it too early; earlier by more than this counts only where the next sample is, too.
    """

    def __init__(
        self,
        tick_s: float,
        *,
        drift_ppm: float = 200.0,
        latency_s: float = 0.0,
        on_break: Callable[[Break], None] = lambda _: None,
        even_s: float = math.inf,
    ) -> None:
        self._tick_ns = tick_s * NS_PER_S
        self._even_ns, self._was_early = even_s * NS_PER_S, False
        self._on_break = on_break
        self._steepest = drift_ppm * 1e-6
        self.latency_ns = round(latency_s * NS_PER_S)
        """Taken off every stamp."""
        self._lowest: deque[Point] = deque(maxlen=SLOPE_BLOCKS)
        self._slope = 0.0
        self._running = False
        self._ticks = self._ticks_0 = 0
        self._last = self._arrival = self._arrival_0 = Stamp(0)
        self._height = self._least = self._block_length = self._block_end = 0.0
        self._least_point: Point = (0.0, 0.0)
        self._late_since: Stamp | None = None
        self._least_late = self._behind_ns = 0.0

    @property
    def drift_ppm(self) -> float:
        """Estimated excess of the device's ticks over nominal."""
        return self._slope * 1e6

    def restart(self) -> None:
        """Forget offset and order, as after a reconnection; the rate found is kept."""
        self._running = False

    def map(self, ticks: int, arrival: Stamp) -> Stamp:
        """Time at which a sample with this tick count was taken.

        Parameters
        ----------
        ticks
            Of the device's clock.
        arrival
            It is never later than this and, between breaks, never earlier than the stamp before.

        Returns
        -------
        Stamp
            By the least delayed arrivals.
        """
        if not self._running or ticks < self._ticks or arrival < self._arrival:
            self._start_over(ticks, arrival)
        self._behind_ns = max(0.0, self._behind_ns - (ticks - self._ticks) * self._tick_ns)
        self._ticks = ticks
        self._arrival = arrival
        x = (ticks - self._ticks_0) * self._tick_ns
        y = arrival - self._arrival_0 - x
        late = y - self._height - self._slope * x
        alone = -JUMP_ns <= late < -self._even_ns and not self._was_early
        self._was_early = late < -self._even_ns
        if alone:
            self._last = Stamp(max(self._last, arrival - self.latency_ns))
            return self._last
        if late < self._least:
            self._least = late
            self._least_point = (x, y)
            if late < 0.0:
                if late < -JUMP_ns and self._lowest:
                    self._break("jump", -late / NS_PER_S, ticks, arrival)
                    return self.map(ticks, arrival)
                self._height += late
                self._least = late = 0.0
        if x >= self._block_end or late > LOST_ns:
            late = self._review(x, late, ticks, arrival)
        else:
            self._late_since = None
        self._last = Stamp(max(self._last, arrival - int(late + self._behind_ns) - self.latency_ns))
        return self._last

    def _start_over(self, ticks: int, arrival: Stamp) -> None:
        """Begin with this count, at the start and after a step back of either clock."""
        if not self._running:
            self._begin(ticks, arrival)
        elif arrival < self._arrival:
            self._break("host step", (self._arrival - arrival) / NS_PER_S, ticks, arrival)
        else:
            self._break("reset", (ticks - self._ticks) * self._tick_ns / NS_PER_S, ticks, arrival)

    def _begin(self, ticks: int, arrival: Stamp) -> None:
        self._running = True
        self._ticks_0 = self._ticks = ticks
        self._arrival_0 = self._arrival = arrival
        self._height = self._behind_ns = 0.0
        self._was_early = False
        self._lowest.clear()
        self._late_since = None
        self._last = Stamp(min(self._last, arrival - self.latency_ns))
        self._open_block(0.0, BLOCK_ns / 8.0)

    def _open_block(self, x: float, length_ns: float) -> None:
        """Short blocks first, so that a rate far off is found before it has done harm."""
        self._block_length = min(length_ns, BLOCK_ns)
        self._block_end = x + self._block_length
        self._least = float("inf")  # so the next sample is the least delayed one

    def _break(self, kind: BreakKind, shift_s: float, ticks: int, arrival: Stamp) -> None:
        self._on_break(Break(kind, shift_s, ticks, arrival))
        self._begin(ticks, arrival)

    def _review(self, x: float, late: float, ticks: int, arrival: Stamp) -> float:
        """Late beyond belief for a second: the device's clock lost that time. End of a block: fit the line."""
        if late <= LOST_ns:
            self._late_since = None
        elif self._late_since is None:
            self._late_since, self._least_late = arrival, late
        else:
            self._least_late = min(self._least_late, late)
            if arrival - self._late_since > NS_PER_S:
                return self._lose(self._least_late, late, ticks, arrival)
        if x < self._block_end:
            return late
        y = late + self._height + self._slope * x
        self._lowest.append(self._least_point)
        self._slope = max(-self._steepest, min(self._steepest, _slope_under(self._lowest)))
        newest = list(self._lowest)[-HEIGHT_BLOCKS:]
        self._height = min(height - self._slope * at for at, height in (*newest, (x, y)))
        self._open_block(x, 2.0 * self._block_length)
        return y - self._height - self._slope * x

    def _lose(self, lost: float, late: float, ticks: int, arrival: Stamp) -> float:
        """Begin anew after the device has lost time, as late as this sample is beside the least delayed one."""
        self._break("jump", -lost / NS_PER_S, ticks, arrival)
        self._height = lost - late
        self._behind_ns = lost if lost <= FOLLOWED_ns else 0.0
        return late - lost


def _slope_under(points: Sequence[Point]) -> float:
    """Slope of the edge of the lower convex hull below the mean abscissa; 0 for a single point."""
    hull: list[Point] = []
    for point in points:
        while len(hull) > 1 and _cross_product(hull[-2], hull[-1], point) <= 0.0:
            hull.pop()
        hull.append(point)
    middle = sum(x for x, _ in points) / len(points)
    for (x1, y1), (x2, y2) in pairwise(hull):
        if x2 >= middle and x2 > x1:
            return (y2 - y1) / (x2 - x1)
    return 0.0


def _cross_product(a: Point, b: Point, c: Point) -> float:
    """Positive where a, b, c turn left, as a lower hull does."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
