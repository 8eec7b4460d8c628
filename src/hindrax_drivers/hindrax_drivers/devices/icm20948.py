"""TDK ICM-20948: specific force and angular rate from its FIFO, magnetic field through its bypass.

The FIFO keeps every sample until it is fetched, so nothing is missed when the host is late, and samples are counted:
they are stamped by the sample clock, not by the wake-up of a thread. Where INT1 is wired to a GPIO, the kernel stamps
the edge of each sample, and no lateness of the host is in the stamps. Source: TDK DS-000189 r1.3.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from hindrax_core.bus_operations import EDGE, EDGES, DeviceError, Pause, Program, Read, Write
from hindrax_core.driver_interface import Identity
from hindrax_core.events import NS_PER_S, Rejected, Stamp, Stamped, after, seconds_between
from hindrax_core.readings import Reading
from hindrax_core.rejects import Reject, RejectCode, reject
from hindrax_core.vehicle import Mount, chip_and_line
from hindrax_drivers.devices.imu import icm20948_registers as r
from hindrax_drivers.devices.imu.ak09916 import Ak09916
from hindrax_drivers.devices.imu.icm20948_samples import Icm20948Knobs, SampleDecoder
from hindrax_drivers.driver import Driver, RegisterPart
from hindrax_drivers.imu_calibration import correction

NO_DATA_S = 0.25
"""Time without a sample after which the sensor is set up anew. That takes 0.15 s, in which no state of the vehicle is
known, and seldom succeeds where transfers fail; to try again takes one cycle."""
MISALIGNED = 5
"""Counts in a row that are no whole number of samples: a sample may be half written, but not every time."""
FASTEST_CLOCK = 1.1
"""Samples may come faster than nominal by the drift of the clock; more than this, and the count itself is wrong."""

SILENT_LINE = reject(
    RejectCode.SILENT,
    "data-ready line",
    found=f"not one edge per sample for {NO_DATA_S} s; the host's time instead",
)

Outputs = list[Stamped[Reading] | Rejected]


DEFAULT_KNOBS = Icm20948Knobs()


class Icm20948(RegisterPart):
    """The sensor at an address (0x68 where none is named), with the calibration of the vehicle file's mount."""

    def __init__(
        self,
        knobs: Icm20948Knobs = DEFAULT_KNOBS,
        address: int | None = None,
        calibration: Mapping[str, tuple[float, ...]] | None = None,
    ) -> None:
        super().__init__(address, r.ADDRESS)
        self._knobs = knobs
        self.period_s = knobs.period_s if knobs.mode == "fifo" else 1.0 / knobs.rate_Hz
        self._samples = SampleDecoder(knobs, correction(calibration or {}, "accel", "mps2"))
        self._mag = Ak09916(correction(calibration or {}, "mag", "T"))
        self._turn = self._misaligned = 0
        self._interrupted = self._torn = self._faulty = False
        self._fetched = self._timed = Stamp(0)
        timed = knobs.data_ready if knobs.mode == "fifo" else ""
        self._chip, self._line = chip_and_line(timed, "data_ready") if timed else ("", 0)

    def configure(self) -> Program[Identity]:
        """Identify, reset, wake, set ranges, filters and rates, find the magnetometer, start the FIFO."""
        yield from self._identify()
        yield from self._reset()
        yield from self._set_up_converters()
        yield self.set(r.USER_CTRL, 0)
        yield self.set(r.INT_PIN_CFG, r.BYPASS_EN)
        yield Pause(0.001)
        mag = (yield from self._mag.configure()) if self._knobs.magnetometer else "no magnetometer wanted"
        yield from self._fetch_temperature()
        if self._knobs.mode == "fifo":
            yield from self._start_fifo()
        if self._chip:
            yield Write(EDGES + self._line, self._chip.encode())
            yield self.set(r.INT_ENABLE_1, r.RAW_DATA_READY)
        self._turn, self._misaligned, self._fetched, self._timed = 0, 0, Stamp(0), Stamp(0)
        self._interrupted = self._torn = self._faulty = False
        self._samples.restart()
        knobs = self._knobs
        timed = f", timed by line {self._line} of {self._chip}" if self._chip else ""
        return Identity(
            f"ICM-20948 at {self.address:#04x}, {mag}, {knobs.rate_Hz:g} Hz, "
            f"{knobs.gyro_range_dps} dps, {knobs.accel_range_g} g{timed}"
        )

    def cycle(self, stamp: Stamp) -> Program[Sequence[Stamped[Reading] | Rejected]]:
        """Read all samples since the last cycle, and at lower rates temperature and magnetic field.

        A transfer that fails is tried again in the next cycle; without a sample for `NO_DATA_S` the error is raised.

        Parameters
        ----------
        stamp
            Begin of the cycle.

        Yields
        ------
        Transaction | Pause
            What it wants from the bus; it returns readings and rejects.
        """
        outputs: Outputs = []
        try:
            if self._interrupted:
                yield from self._check_awake()
            yield from self._fetch(stamp, outputs)
        except DeviceError as error:
            self._interrupted = True
            if self._faulty or self._silent_s(stamp) > NO_DATA_S:
                raise
            return [*outputs, Rejected(stamp, reject(RejectCode.BUS, found=f"{error}; tried again"), b"")]
        self._interrupted = False
        return outputs

    def _fetch(self, stamp: Stamp, outputs: Outputs) -> Program[None]:
        """Add what there is to the outputs, which are kept where a later transfer fails."""
        knobs = self._knobs
        outputs += yield from self._fetch_fifo(stamp) if knobs.mode == "fifo" else self._fetch_newest(stamp)
        if self._samples.hung:
            raise self._failed("repeats the same sample")
        self._turn += 1
        if knobs.magnetometer and self._turn % knobs.magnetometer_every == 0:
            outputs += yield from self._mag.read(stamp)
        if self._turn % knobs.temperature_every == 0:
            yield from self._fetch_temperature()

    def _check_awake(self) -> Program[None]:
        """After a transfer that failed: it may have come from a reset, in which the sensor sleeps."""
        if (yield self.get(r.PWR_MGMT_1, 1))[0] != r.CLOCK_AUTO:
            raise self._failed("has reset itself")

    def _identify(self) -> Program[None]:
        yield self._bank(0)
        found = (yield self.get(r.WHO_AM_I, 1))[0]
        if found != r.IDENTITY:
            ids = f"found WHO_AM_I {found:#04x}, wanted {r.IDENTITY:#04x} (ICM-20948)"
            raise self.error(f"{ids}; another device answers at this address")

    def _reset(self) -> Program[None]:
        yield self.set(r.PWR_MGMT_1, r.DEVICE_RESET)
        yield Pause(0.1)
        yield self._bank(0)
        for _ in range(10):
            if not (yield self.get(r.PWR_MGMT_1, 1))[0] & r.DEVICE_RESET:
                break
            yield Pause(0.01)
        else:
            raise self.error("does not come out of its reset; power-cycle it")
        yield self.set(r.PWR_MGMT_1, r.CLOCK_AUTO)
        yield Pause(0.035)
        yield self.set(r.PWR_MGMT_2, 0)
        yield self.set(r.LP_CONFIG, 0)

    def _set_up_converters(self) -> Program[None]:
        """Write bank 2 and read it back: a lost setting would scale every reading wrongly."""
        knobs = self._knobs
        gyro = r.config_byte(knobs.filter, r.GYRO_RANGES.index(knobs.gyro_range_dps))
        accel = r.config_byte(knobs.filter, r.ACCEL_RANGES.index(knobs.accel_range_g))
        yield self._bank(2)
        for register, value in (
            (r.GYRO_SMPLRT_DIV, knobs.divider),
            (r.GYRO_CONFIG_1, gyro),
            (r.ACCEL_SMPLRT_DIV_1, 0),
            (r.ACCEL_SMPLRT_DIV_2, knobs.divider),
            (r.ACCEL_CONFIG, accel),
            (r.ODR_ALIGN_EN, 1),
        ):
            yield self.set(register, value)
        for register, value in ((r.GYRO_CONFIG_1, gyro), (r.ACCEL_CONFIG, accel)):
            found = (yield self.get(register, 1))[0]
            if found != value:
                values = f"reads {found:#04x}, wanted {value:#04x} as written"
                raise self.error(f"bank 2 register {register:#04x} {values}; check the wiring")
        yield self._bank(0)

    def _start_fifo(self) -> Program[None]:
        yield self.set(r.FIFO_EN_1, 0)
        yield self.set(r.FIFO_EN_2, r.FIFO_GYRO_AND_ACCEL)
        yield self.set(r.FIFO_MODE, 0)
        yield self.set(r.USER_CTRL, r.USER_FIFO_EN)
        yield from self._empty_fifo()

    def _empty_fifo(self) -> Program[None]:
        yield self.set(r.FIFO_RST, r.FIFO_ALL)
        yield self.set(r.FIFO_RST, 0)

    def _fetch_fifo(self, stamp: Stamp) -> Program[Outputs]:
        """Read the count, then all samples in one burst; a FIFO that has overflowed is emptied."""
        last = yield from self._fetch_edge()
        raw = yield self.get(r.FIFO_COUNTH, 2)
        count = int.from_bytes(raw, "big")
        wrong = self._fifo_fault(count, stamp)
        if wrong:
            yield from self._empty_fifo()
            self._samples.restart()
            self._misaligned, self._fetched, self._torn = 0, stamp, False
            return [Rejected(stamp, wrong, raw)]
        if count == 0 or self._misaligned:
            return self._on_empty_fifo(stamp)
        if self._torn:
            self._samples.restart()  # their number is unknown
        # A burst that fails has mostly taken nothing: what waits is fetched with the next samples.
        self._torn = True
        data = yield self.get(r.FIFO_R_W, count)
        edge = yield from self._fetch_edge()
        self._fetched, self._torn = stamp, False
        if not self._chip:
            return self._samples.decode(data, stamp)
        still = edge == last and abs(EDGE.unpack(edge)[1] - stamp) < NS_PER_S * FASTEST_CLOCK / self._knobs.rate_Hz
        outputs = self._samples.decode(data, stamp, EDGE.unpack(edge) if still else None)
        return outputs + self._watch_line(stamp, edge)

    def _fetch_edge(self) -> Program[bytes]:
        """Count and time of the newest edge; unchanged over a burst, it is that of the newest sample in it."""
        return (yield Read(EDGES + self._line, EDGE.size)) if self._chip else b""

    def _watch_line(self, stamp: Stamp, edge: bytes) -> Outputs:
        """Tell, four times a second, that the line does not give the time of the samples."""
        if self._samples.by_edges or not 0 < self._timed <= stamp:
            self._timed = stamp
        if seconds_between(self._timed, stamp) <= NO_DATA_S:
            return []
        self._timed = stamp
        return [Rejected(stamp, SILENT_LINE, edge)]

    def _fifo_fault(self, count: int, stamp: Stamp) -> Reject | None:
        """Reason why the FIFO must be emptied at this fill level, if any; a half-written sample is waited for."""
        if count > r.FIFO_BYTES - r.SAMPLE_BYTES:
            return reject(RejectCode.OVERFLOW, found=f"FIFO overflow: {count} bytes waiting, samples are lost")
        elapsed_s = seconds_between(self._fetched, stamp)
        most = 4 + FASTEST_CLOCK * elapsed_s * self._knobs.rate_Hz
        self._misaligned = self._misaligned + 1 if count % r.SAMPLE_BYTES else 0
        if self._misaligned >= (1 if self._torn else MISALIGNED):
            found = f"FIFO out of step: {count} bytes are no whole number of samples"
            return reject(RejectCode.OUT_OF_STEP, found=found)
        if self._fetched and elapsed_s >= 0.0 and count > most * r.SAMPLE_BYTES:
            found = f"FIFO count {count} is more than {elapsed_s:.3f} s can have brought"
            return reject(RejectCode.TOO_MANY, found=found)
        return None

    def _fetch_newest(self, stamp: Stamp) -> Program[Outputs]:
        status = (yield self.get(r.INT_STATUS_1, 1))[0]
        if not status & r.RAW_DATA_READY:
            return self._on_empty_fifo(stamp)
        data = yield self.get(r.ACCEL_XOUT_H, r.SAMPLE_BYTES)
        self._fetched = stamp
        # Half a period old on average; the number of skipped samples is unknown and not counted.
        return self._samples.decode_one(data, after(stamp, -0.5 / self._knobs.rate_Hz - self._knobs.filter_delay_s))

    def _fetch_temperature(self) -> Program[None]:
        raw = yield self.get(r.TEMP_OUT_H, 2)
        self._samples.temperature_C = r.temperature_C(int.from_bytes(raw, "big", signed=True))

    def _on_empty_fifo(self, stamp: Stamp) -> Outputs:
        """Check an empty FIFO: a sensor that has reset itself sleeps and gives no samples."""
        if self._silent_s(stamp) > NO_DATA_S:
            raise self._failed(f"no sample for {NO_DATA_S} s; it may have reset itself")
        return []

    def _silent_s(self, stamp: Stamp) -> float:
        """Time since the last samples, or since the first look for any."""
        if not 0 < self._fetched <= stamp:  # just configured, or the host's clock was set back
            self._fetched = stamp
        return seconds_between(self._fetched, stamp)

    def _failed(self, text: str) -> DeviceError:
        """Error of the sensor and not of the wire: nothing is tried again."""
        self._faulty = True
        return self.error(text)

    def _bank(self, number: int) -> Write:
        return self.set(r.BANK, number << 4)


def _make(knobs: Icm20948Knobs, mount: Mount, _vehicle: object) -> Icm20948:
    """Sensor of a mount; the parameter for the line goes before the vehicle file's."""
    if knobs.data_ready is None:
        knobs = replace(knobs, data_ready=mount.data_ready)
    return Icm20948(knobs, mount.address, mount.calibration)


DRIVER = Driver(Icm20948Knobs, _make)
