"""Running sums of what the accelerometer pushes between late measurements, remembered for a while."""

from collections import deque


class PastSums:
    """Sums of complex numbers; their values at a time of the past are interpolated."""

    def __init__(self, count: int, memory_s: float) -> None:
        self._memory_s = memory_s
        self._rows: deque[tuple[float, tuple[complex, ...]]] = deque([(0.0, (0j,) * count)])

    def add(self, changes: tuple[complex, ...], now_s: float) -> None:
        """Add one more change of each sum."""
        rows = self._rows
        rows.append((now_s, tuple(old + new for old, new in zip(rows[-1][1], changes, strict=True))))
        while rows[0][0] < now_s - self._memory_s:
            rows.popleft()

    def at(self, time_s: float) -> tuple[complex, ...] | None:
        """Sums at a time of the past; None when they are forgotten, or not yet known."""
        rows = self._rows
        if not rows[0][0] <= time_s <= rows[-1][0]:
            return None
        later_s, later = rows[-1]
        for row_s, row in reversed(rows):
            if row_s <= time_s:
                share = (time_s - row_s) / (later_s - row_s) if later_s > row_s else 0.0
                return tuple(low + share * (high - low) for low, high in zip(row, later, strict=True))
            later_s, later = row_s, row
        return None
