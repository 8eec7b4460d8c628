"""Settings of an ICM-20948, and its sample bytes to readings: scale, correct, stamp, refuse implausible samples."""

import struct
from dataclasses import dataclass
from itertools import pairwise

from hindrax_core.events import NS_PER_S, Rejected, Stamp, Stamped
from hindrax_core.knobs import choice, knob
from hindrax_core.readings import Inertial, Reading
from hindrax_core.rejects import Reject, RejectCode, reject
from hindrax_core.vehicle import chip_and_line
from hindrax_drivers.devices.imu import icm20948_registers as r
from hindrax_drivers.imu_calibration import Correction
from hindrax_drivers.timebase import Timebase

SAMPLE = struct.Struct(">6h")
LEAST_COUNT, MOST_COUNT = -32768, 32767
"""Value at the end of the range."""
REPEATS = 2
"""The noise of six axes is several counts each: more equal samples in a row than this are a device that has hung."""
HUNG_AFTER = 50
ACCEPT_AFTER = 3
"""A step this often confirmed by the samples after it was real, however large."""

FILL = 0.6
"""Share of the FIFO that may fill up between two cycles; the rest is for a host that is late."""

LONGEST_GAP_ns = 0.25 * NS_PER_S
LARGEST_DRIFT = 0.1
EVEN_S = 0.01
"""Fetches are even to two samples: one that is earlier by more began before its process was kept waiting."""

Outputs = list[Stamped[Reading] | Rejected]
Raw = tuple[int, int, int, int, int, int]


@dataclass(frozen=True, slots=True)
class Icm20948Knobs:
    """Settings of the inertial sensor."""

    mode: str = choice("fifo", ("fifo", "burst"), "fetch all samples from the FIFO, or the newest from the registers")
    divider: int = knob(4, 0, 255, "sample rate is 1125 Hz / (1 + divider) [-]")
    period_s: float = knob(0.02, 0.001, 0.2, "time between two fetches [s]")
    gyro_range_dps: str = choice("500", r.GYRO_RANGES, "full scale of the gyroscope [dps]")
    accel_range_g: str = choice("4", r.ACCEL_RANGES, "full scale of the accelerometer [g]")
    filter: int = knob(3, 0, 7, "low-pass filter of both; 3: 51 Hz gyroscope, 50 Hz accelerometer [-]")
    drift_ppm: float = knob(50_000.0, 0.0, 50_000.0, "largest accepted error of the sample clock [ppm]")
    magnetometer: bool = knob(True, meaning="whether the magnetometer is used")
    magnetometer_every: int = knob(2, 1, 1000, "the magnetometer is read in every n-th cycle [-]")
    temperature_every: int = knob(50, 1, 100_000, "the die temperature is read in every n-th cycle [-]")
    largest_rate_change_radps2: float = knob(225.0, 0.0, 1e5, "faster changes of the rate are damage [rad/s^2]")
    largest_force_change_mps3: float = knob(1125.0, 0.0, 1e6, "faster changes of the specific force are damage [m/s^3]")

    data_ready: str | None = knob(
        None, meaning="GPIO that INT1 is wired to, CHIP:LINE; times the FIFO's samples; none: by the vehicle file"
    )

    @property
    def rate_Hz(self) -> float:
        """Nominal sample rate."""
        return r.BASE_RATE_Hz / (1 + self.divider)

    @property
    def filter_delay_s(self) -> float:
        """Delay of the low-pass filter, taken off the stamps."""
        return r.FILTER_DELAY_S[self.filter]

    def __post_init__(self) -> None:
        """Check that the FIFO cannot overflow in normal operation, and the name of the line."""
        if self.data_ready:
            chip_and_line(self.data_ready, "data_ready")
        wanted = self.period_s * self.rate_Hz * r.SAMPLE_BYTES
        if self.mode == "fifo" and wanted > FILL * r.FIFO_BYTES:
            longest = FILL * r.FIFO_BYTES / r.SAMPLE_BYTES / self.rate_Hz
            raise ValueError(
                f"period_s: found {self.period_s:g}, wanted at most {longest:.3g} at {self.rate_Hz:g} Hz (FIFO size)"
            )


class EdgeClock:
    """Times of samples by the edges of their data-ready line, and by the measured period where an edge is missed."""

    def __init__(self, period_ns: float) -> None:
        self._nominal_ns = self.period_ns = period_ns
        """Time between two samples: nominal, and as measured."""
        self.restart()

    def restart(self) -> None:
        """Forget which edge belongs to which sample."""
        self._ahead: int | None = None
        self._anchor: tuple[int, int] | None = None

    def map(self, ticks: int, edge: tuple[int, int] | None) -> int | None:
        """Time a sample by the edge that announced it.

        An edge counts if as many are ahead of the samples as at the last one: a lost or foreign edge times nothing.

        Parameters
        ----------
        ticks
            Number of the sample.
        edge
            Number and time [ns] of the newest edge, if its own.

        Returns
        -------
        int | None
            Time [ns]; None without an edge.
        """
        if edge is not None:
            before, self._ahead = self._ahead, edge[0] - ticks
            if before == self._ahead:
                self._on_edge(ticks, edge[1])
        if self._anchor is None:
            return None
        passed_ns = (ticks - self._anchor[0]) * self.period_ns
        return self._anchor[1] + round(passed_ns) if passed_ns < LONGEST_GAP_ns else None

    def _on_edge(self, ticks: int, time_ns: int) -> None:
        if self._anchor is not None and ticks > self._anchor[0]:
            period_ns = (time_ns - self._anchor[1]) / (ticks - self._anchor[0])
            if abs(period_ns - self._nominal_ns) < LARGEST_DRIFT * self._nominal_ns:  # else the host's clock was set
                self.period_ns = period_ns
        self._anchor = (ticks, time_ns)


class SampleDecoder:
    """Decodes samples of 12 bytes in the order in which they were taken; the n-th is tick n of the sample clock."""

    def __init__(self, knobs: Icm20948Knobs, correction: Correction) -> None:
        self._gyro_scale = r.gyro_radps_per_lsb(r.GYRO_RANGES.index(knobs.gyro_range_dps))
        self._accel_scale = r.accel_mps2_per_lsb(r.ACCEL_RANGES.index(knobs.accel_range_g))
        self._rate_step = knobs.largest_rate_change_radps2 / knobs.rate_Hz / self._gyro_scale
        self._force_step = knobs.largest_force_change_mps3 / knobs.rate_Hz / self._accel_scale
        self._correction = None if correction.idle else correction
        self._timebase = Timebase(
            1.0 / knobs.rate_Hz, drift_ppm=knobs.drift_ppm, latency_s=knobs.filter_delay_s, even_s=EVEN_S
        )
        self._period_ns = NS_PER_S / knobs.rate_Hz
        self._edge_clock = EdgeClock(self._period_ns)
        self.by_edges = False
        """Whether edges have timed the last samples."""
        self.temperature_C = float("nan")
        self.restart()

    def restart(self) -> None:
        """Restart the sample count after a gap."""
        self._timebase.restart()
        self._edge_clock.restart()
        self._ticks = 0
        self._stamp = Stamp(0)
        self._last: Raw | None = None
        self._repeats = self._leaps = 0

    @property
    def hung(self) -> bool:
        """Whether samples have been equal for so long that a reset is needed."""
        return self._repeats > HUNG_AFTER

    def decode(self, data: bytes, arrival: Stamp, edge: tuple[int, int] | None = None) -> Outputs:
        """Decode whole samples that arrived together, oldest first.

        Parameters
        ----------
        data
            Of the FIFO.
        arrival
            Only the newest sample informs the sample clock: the others waited for it.
        edge
            As of `EdgeClock`.

        Returns
        -------
        Outputs
            Readings and rejects.
        """
        outputs: Outputs = []
        count = len(data) // SAMPLE.size
        self._ticks += count
        newest = self._timebase.map(self._ticks, arrival)
        timed = self._edge_clock.map(self._ticks, edge)
        self.by_edges = timed is not None
        if arrival < self._stamp:  # no stamp is later than its arrival: the host's clock was set back
            self._stamp = Stamp(0)
        period_ns = self._period_ns * (1.0 + 1e-6 * self._timebase.drift_ppm)
        if timed is not None:
            newest, period_ns = Stamp(timed - self._timebase.latency_ns), self._edge_clock.period_ns
        if self._last is None:
            self._begin_with(data)
        for older, raw in zip(range(count - 1, -1, -1), SAMPLE.iter_unpack(data), strict=True):
            stamp = self._stamp = max(self._stamp, Stamp(newest - round(older * period_ns)))
            reason = self._implausible(raw)
            outputs.append(Rejected(stamp, reason, SAMPLE.pack(*raw)) if reason else self._reading(raw, stamp))
        return outputs

    def _begin_with(self, data: bytes) -> None:
        """Start from the first sample that its successor confirms: the first has no predecessor to compare with."""
        for raw, following in pairwise(SAMPLE.iter_unpack(data)):
            if not self._jumps(raw, following):
                self._last, self._repeats = raw, -1
                return

    def decode_one(self, data: bytes, stamp: Stamp) -> Outputs:
        """Decode one sample that has its stamp already; several may have been skipped before it."""
        raw = SAMPLE.unpack(data)
        periods = max(1.0, (stamp - self._stamp) / self._period_ns)
        self._stamp = stamp
        reason = self._implausible(raw, periods)
        return [Rejected(stamp, reason, data) if reason else self._reading(raw, stamp)]

    def _reading(self, raw: tuple[int, ...], stamp: Stamp) -> Stamped[Reading]:
        ax, ay, az, gx, gy, gz = raw
        a, g = self._accel_scale, self._gyro_scale
        force = (a * ax, a * ay, a * az)
        if self._correction is not None:
            force = self._correction.apply(*force)
        return Stamped(stamp, Inertial(force, (g * gx, g * gy, g * gz), self.temperature_C))

    def _implausible(self, raw: Raw, periods: float = 1.0) -> Reject | None:
        """Reason why a sample so many periods after the one before is implausible; None when it is plausible."""
        last = self._last
        if raw == last:
            self._repeats += 1
            repeated = reject(RejectCode.REPEATED, found=f"{self._repeats + 1} equal samples")
            return repeated if self._repeats > REPEATS else None
        self._repeats = 0
        if LEAST_COUNT in raw or MOST_COUNT in raw:
            return reject(RejectCode.SATURATED, found="saturated: the motion exceeds the range")
        if last is not None and self._jumps(raw, last, periods) and self._leaps < ACCEPT_AFTER:
            self._leaps += 1
            return reject(RejectCode.LEAP, found="leap: no vehicle moves like that")
        self._leaps = 0
        self._last = raw
        return None

    def _jumps(self, raw: Raw, last: Raw, periods: float = 1.0) -> bool:
        force, rate = self._force_step * periods, self._rate_step * periods
        return (
            abs(raw[0] - last[0]) > force
            or abs(raw[1] - last[1]) > force
            or abs(raw[2] - last[2]) > force
            or abs(raw[3] - last[3]) > rate
            or abs(raw[4] - last[4]) > rate
            or abs(raw[5] - last[5]) > rate
        )
