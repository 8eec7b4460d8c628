"""Checks of a Raspberry Pi 4: its boot settings, rules and kernel. Nothing is run, files are read.

Sources: Raspberry Pi's boot/overlays/README (dtparam, uart overlays) and its documentation of config.txt and of
`vcgencmd get_throttled`; raspberrypi/linux issue 4884 (SCL follows the core clock).
"""

import contextlib
from pathlib import Path

from hindrax_cli.health_checks import Check

BOARD = "Raspberry Pi 4"
MODEL = "proc/device-tree/model"
CONFIGS = ("boot/firmware/config.txt", "boot/config.txt")
RULES = "etc/udev/rules.d/60-hindrax.rules"
UNIT = "etc/systemd/system/multi-user.target.wants/hindrax.service"
I2C_SPEED = "sys/class/i2c-adapter/i2c-1/of_node/clock-frequency"
THROTTLED = "sys/devices/platform/soc/soc:firmware/get_throttled"
FTDI = "sys/bus/usb-serial/devices/*/latency_timer"
I2C_Hz = 400_000
UARTS = ("uart3", "uart5")
UNDER_VOLTAGE, UNDER_VOLTAGE_BEFORE = 0x1, 0x10000
LATENCY_ms = 1
SET_UP = "sudo docker/pi/set-up.sh"
REBOOT = f"{SET_UP}, then sudo reboot"


def board(root: Path = Path("/")) -> list[Check]:
    """All of it on a Raspberry Pi 4; elsewhere nothing, because there is nothing to be right or wrong."""
    model = _text(root / MODEL).rstrip("\0")
    if not model.startswith(BOARD):
        return []
    settings = _settings(root)
    checks = [Check("board", model), i2c_speed(root, settings), core_clock(settings), uarts(settings)]
    checks += [names(root), service(root), power(root)]
    return checks + [adapter(path) for path in sorted(root.glob(FTDI))]


def i2c_speed(root: Path, settings: dict[str, list[str]]) -> Check:
    """400 kHz: at 100 kHz the bus cannot carry 225 inertial samples and 50 sets of pulses a second."""
    wanted = f"i2c_arm_baudrate={I2C_Hz}"
    asked = [word for line in settings.get("dtparam", []) for word in line.split(",")]
    with contextlib.suppress(OSError):
        found = int.from_bytes((root / I2C_SPEED).read_bytes()[:4], "big")
        if found == I2C_Hz:
            return Check("i2c speed", f"{found // 1000} kHz")
        booted = "" if wanted in asked else " and not enabled"
        return Check("i2c speed", f"{found // 1000} kHz, wanted {I2C_Hz // 1000}{booted}", REBOOT)
    if "i2c_arm=on" not in asked:
        return Check("i2c speed", "I2C is switched off", REBOOT)
    return Check("i2c speed", "there is no adapter i2c-1, though it is enabled", "sudo modprobe i2c-dev; sudo reboot")


def core_clock(settings: dict[str, list[str]]) -> Check:
    """The clock of I2C is divided from the core clock, which must not change with the load."""
    fixed, least = (settings.get(key, [""])[-1] for key in ("core_freq", "core_freq_min"))
    if fixed and fixed == least:
        return Check("core clock", f"fixed at {fixed} MHz")
    return Check("core clock", "changes with the load, and the speed of I2C with it", REBOOT)


def uarts(settings: dict[str, list[str]]) -> Check:
    """The UARTs of DVL and Ping; their baud rate does not follow the core clock, as that of the mini UART does."""
    lacking = [name for name in UARTS if name not in (line.split(",")[0] for line in settings.get("dtoverlay", []))]
    if lacking:
        return Check("uarts", f"{', '.join(lacking)} switched off", REBOOT)
    return Check("uarts", f"{', '.join(UARTS)} switched on")


def names(root: Path) -> Check:
    """The rules that make /dev/hindrax/dvl and ping."""
    ours = Path(__file__).parents[4] / "docker/pi/60-hindrax.rules"
    found = _text(root / RULES)
    if not found:
        return Check("device names", f"no /{RULES}: ports keep the names of the kernel, which change", SET_UP)
    if ours.is_file() and found != _text(ours):
        return Check("device names", f"/{RULES} differs from the file of this version", SET_UP)
    links = sorted(link.name for link in (root / "dev/hindrax").glob("*"))
    return Check("device names", f"/dev/hindrax: {', '.join(links) or 'empty, nothing is plugged in'}")


def service(root: Path) -> Check:
    """Whether the stack starts with the machine."""
    if (root / UNIT).is_symlink() or (root / UNIT).exists():
        return Check("service", "hindrax.service starts with the machine")
    if _text(root / "etc/hindrax/hindrax.env"):
        return Check("service", "no hindrax.service; the container has its own restart policy")
    return Check("service", "the stack does not start with the machine", SET_UP)


def power(root: Path) -> Check:
    """Under-voltage: a Pi that browns out drops bytes before it drops out."""
    text = _text(root / THROTTLED).strip()
    if not text:
        return Check("power", "not reported by this kernel")
    flags = int(text, 16)
    if flags & UNDER_VOLTAGE:
        return Check("power", "under-voltage now", "give it 5.1 V and 3 A; check cable, plug and converter")
    if flags & UNDER_VOLTAGE_BEFORE:
        remedy = "check cable, plug and converter, then reboot"
        return Check("power", "there was under-voltage since the start", remedy)
    return Check("power", "no under-voltage since the start")


def adapter(latency: Path) -> Check:
    """Latency timer of a USB adapter."""
    name, held_ms = latency.parent.name, int(_text(latency) or 0)
    if held_ms > LATENCY_ms:
        return Check(name, f"keeps bytes for {held_ms} ms, wanted {LATENCY_ms}", f"{SET_UP}, then plug it in again")
    return Check(name, f"keeps bytes for {held_ms} ms")


def _settings(root: Path) -> dict[str, list[str]]:
    """Values of every key of config.txt that are in force on a Pi 4, in order."""
    found: dict[str, list[str]] = {}
    in_force = True
    text = next(filter(None, (_text(root / name) for name in CONFIGS)), "")
    for line in (line.partition("#")[0].strip() for line in text.splitlines()):
        if line.startswith("["):
            in_force = line in ("[all]", "[pi4]")
        elif in_force and "=" in line:
            key, _, value = line.partition("=")
            found.setdefault(key.strip(), []).append(value.strip())
    return found


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
