"""FIFO of the ICM-20948, and the I2C master inside it, which reads the magnetometer for hosts without the bypass.

Source: TDK DS-000189 r1.3, registers 0x66 to 0x72, sections 7.2 and 10.
"""

from hindrax_sim.devices.imu.ak09916 import Ak09916

MAG_ADDRESS = 0x0C
SLV4_ADDR, SLV4_REG, SLV4_CTRL, SLV4_DO, SLV4_DI = 0x13, 0x14, 0x15, 0x16, 0x17
SLV_CTRL = (0x05, 0x09, 0x0D, 0x11)
ENABLE, READ, LENGTH = 0x80, 0x80, 0x0F
STATUS_DONE, STATUS_NACK_4 = 0x40, 0x10
EXTERNAL_BYTES = 24

FIFO_BYTES = 512
ACCEL, TEMPERATURE, SNAPSHOT, NOTHING = 0x10, 0x01, 0x01, 0xFF


class Fifo:
    """First in, first out; when full, stream mode loses its oldest bytes."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self.overflowed = False

    def __len__(self) -> int:
        return len(self._bytes)

    def empty(self) -> None:
        """Clear content and overflow."""
        self._bytes.clear()
        self.overflowed = False

    def push(self, sample: bytes, temperature: bytes, chosen: int, mode: int) -> None:
        """Append the chosen parts of a sample. A full FIFO loses its oldest bytes, or in snapshot mode the new ones.

        Parameters
        ----------
        sample : 12 bytes
            Accelerations, then rates, big-endian, as in ACCEL_XOUT_H to GYRO_ZOUT_L.
        temperature : 2 bytes
            As in TEMP_OUT.
        chosen
            FIFO_EN_2.
        mode
            FIFO_MODE.
        """
        parts = sample[0:6] if chosen & ACCEL else b""
        for axis in range(3):
            parts += sample[6 + 2 * axis : 8 + 2 * axis] if chosen & 0x02 << axis else b""
        parts += temperature if chosen & TEMPERATURE else b""
        over = len(self._bytes) + len(parts) - FIFO_BYTES
        if over > 0:
            self.overflowed = True
            if mode & SNAPSHOT:
                return
            del self._bytes[:over]
        self._bytes += parts

    def pop(self, count: int) -> bytes:
        """Remove and return bytes; an empty FIFO gives ones."""
        found = bytes(self._bytes[:count])
        del self._bytes[:count]
        return found + bytes([NOTHING]) * (count - len(found))


class InnerMaster:
    """Works on the registers of bank 3; `external` is what appears at EXT_SLV_SENS_DATA, `status` at I2C_MST_STATUS.

    Slaves 0 to 3 are served once per sample, slave 4 once per request.
    """

    def __init__(self, magnetometer: Ak09916) -> None:
        self._magnetometer = magnetometer
        self.power_cycle()

    def power_cycle(self) -> None:
        """Clear data and status."""
        self.external = bytearray(EXTERNAL_BYTES)
        self.status = 0

    def serve(self, bank: bytearray, now_s: float) -> None:
        """Run the transfers of slaves 0 to 3."""
        place = 0
        for number, control_at in enumerate(SLV_CTRL):
            address, register, control, out = bank[control_at - 2 : control_at + 2]
            if not control & ENABLE:
                continue
            length = control & LENGTH
            if address & 0x7F != MAG_ADDRESS:
                self.status |= 1 << number
            elif address & READ:
                self._magnetometer.write(bytes([register]), now_s)
                end = min(place + length, EXTERNAL_BYTES)
                self.external[place:end] = self._magnetometer.read(length, now_s)[: end - place]
            else:
                self._magnetometer.write(bytes([register, out]), now_s)
            place += length if address & READ else 0

    def serve_once(self, bank: bytearray, now_s: float) -> None:
        """Run the requested transfer of slave 4."""
        if not bank[SLV4_CTRL] & ENABLE:
            return
        bank[SLV4_CTRL] &= ~ENABLE & 0xFF
        self.status |= STATUS_DONE
        if bank[SLV4_ADDR] & 0x7F != MAG_ADDRESS:
            self.status |= STATUS_NACK_4
        elif bank[SLV4_ADDR] & READ:
            self._magnetometer.write(bytes([bank[SLV4_REG]]), now_s)
            bank[SLV4_DI] = self._magnetometer.read(1, now_s)[0]
        else:
            self._magnetometer.write(bytes([bank[SLV4_REG], bank[SLV4_DO]]), now_s)
