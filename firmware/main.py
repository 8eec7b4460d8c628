# ruff: noqa: INP001 - the board runs this file by its name, it is no part of a package
"""Pins, timers, link and watchdog of the thruster controller on an STM32F407 (MicroPython, port stm32).

Copy this file and the folder `hindrax_mcu` to the board. The tables below fit the STM32F4 Discovery; other boards
differ in their pins only.
"""

import time

import machine
import pyb
from hindrax_mcu.controller import Controller

# Pin, timer, channel of each thruster in the order of the host's channels, then of each light.
THRUSTERS = (
    ("PC6", 3, 1),
    ("PC7", 3, 2),
    ("PC8", 3, 3),
    ("PC9", 3, 4),
    ("PD12", 4, 1),
    ("PD13", 4, 2),
    ("PD14", 4, 3),
    ("PD15", 4, 4),
)
LIGHTS = (("PE5", 9, 1), ("PE6", 9, 2))
PERIOD_us = 5000  # 200 pulses per second
USE_USB = False
UART, BAUD = 2, 115200  # TX PA2, RX PA3
BATTERY_PIN, MILLIVOLTS_PER_COUNT = "", 4.0
WATCHDOG_ms = 500


class Outputs:
    """Pulses from timers that count microseconds: the hardware repeats them without the program."""

    def __init__(self, pulses: list[int]) -> None:
        """Start every channel with its pulse."""
        timers = {}
        self._channels = []
        # MicroPython's zip takes no `strict`.
        for (pin, number, channel), pulse in zip(THRUSTERS + LIGHTS, pulses):  # noqa: B905 - see above
            if number not in timers:
                timer = timers[number] = pyb.Timer(number)
                timer.init(prescaler=timer.source_freq() // 1000000 - 1, period=PERIOD_us - 1)
            made = timers[number].channel(channel, pyb.Timer.PWM, pin=pyb.Pin(pin), pulse_width=pulse)
            self._channels.append(made)

    def write(self, pulses: list[int]) -> None:
        """Change every pulse; each takes effect with its next period."""
        for channel, pulse in zip(self._channels, pulses):  # noqa: B905 - MicroPython's zip takes no `strict`
            channel.pulse_width(pulse)


class Clock:
    """Monotonic milliseconds from a counter that wraps."""

    def __init__(self) -> None:
        """Begin at zero."""
        self._ticks, self._total = time.ticks_ms(), 0

    def now_ms(self) -> int:
        """Milliseconds since the start."""
        ticks = time.ticks_ms()
        self._total += time.ticks_diff(ticks, self._ticks)
        self._ticks = ticks
        return self._total


class Board:
    """The board: outputs, clock, link, battery, watchdog."""

    def __init__(self) -> None:
        """Start neutral, then link, battery and, last, the watchdog, which cannot be stopped again."""
        self.clock = Clock()
        self.controller = Controller(len(THRUSTERS), len(LIGHTS), self.clock.now_ms())
        self.outputs = Outputs(self.controller.pulses)
        self.link = self._open_link()
        self.battery = pyb.ADC(pyb.Pin(BATTERY_PIN)) if BATTERY_PIN else None
        self.watchdog = machine.WDT(timeout=WATCHDOG_ms)

    def turn(self) -> None:
        """Read, decide, output, report. The watchdog is fed only after all of it."""
        data = self.link.read(256) if self.link.any() else None
        replies = self.controller.receive(data, self.clock.now_ms()) if data else b""
        if self.battery is not None:
            self.controller.millivolts = int(self.battery.read() * MILLIVOLTS_PER_COUNT)
        replies += self.controller.step(self.clock.now_ms())
        self.outputs.write(self.controller.pulses)
        if replies:
            self.link.write(replies)
        self.watchdog.feed()

    def _open_link(self):  # noqa: ANN202 - a UART or a USB port, which have no common name
        if not USE_USB:
            return pyb.UART(UART, BAUD, timeout=0, rxbuf=512)
        link = pyb.USB_VCP()
        link.setinterrupt(-1)  # 0x03 is a byte like any other, not Ctrl-C
        return link


def main() -> None:
    """Run until power-off."""
    board = Board()
    while True:
        board.turn()
        time.sleep_ms(1)


if __name__ == "__main__":
    main()
