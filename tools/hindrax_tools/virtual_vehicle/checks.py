"""What the virtual vehicle has to survive, each check with its findings. Times are those of the machine."""

import random
import shlex
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from hindrax_bag.read.bag_reader import messages
from hindrax_bag.read.survey import survey
from hindrax_bringup.share_files import default_vehicle, optional_sensors
from hindrax_core.errors import HindraxError
from hindrax_core.events import NS_PER_S, Rejected, Stamp
from hindrax_drivers.buses.gpio import CONSUMER
from hindrax_drivers.buses.line import TCP_PREFIX
from hindrax_drivers.devices.icm20948 import SILENT_LINE
from hindrax_sim.buses.serial_ends import SERVED
from hindrax_tools.virtual_vehicle.gpio import CUT_ENABLE, CUT_READY, LEAK
from hindrax_tools.virtual_vehicle.hardware import FOLDER, Seen, seen_in, thrust_after_s
from hindrax_tools.virtual_vehicle.machine import ADAPTER, HOST, STARTED, Machine

RUNS = "/var/lib/hindrax/runs"
HINDRAX = "cd /tmp && sudo -u hindrax HINDRAX_RUNTIME_DIR=/run/hindrax /opt/hindrax/hindrax"
CGROUP = "/sys/fs/cgroup/system.slice/hindrax.service"
NEUTRAL_S, LOST_S, STEP_S = 15.0, 2.0, 3600
"""Until neutral by a new process, at most; what a power cut may lose; a step."""
OFF_S, HELD_S, SETTLED_S = 0.5, 3.0, 1.0
"""Until an enable line takes thrust off the wires, at most: a timer holds it for 0.3 s; how long a harm lasts; until
what it has changed is as before."""
PAUSE_S = 2.0
"""Between two questions for the health: each takes a second of an emulated processor, from the stack that starts."""
ATTEMPTS = 3
VEHICLE_FILE = "/etc/hindrax/all-devices.yaml"
CHIP = "pinctrl-bcm2711"
HELD_LINES = f"""
import gpiod
chip = gpiod.Chip("/dev/gpiochip0")
print(sum(chip.get_line_info(line).consumer == "{CONSUMER}" for line in range(chip.get_info().num_lines)))
"""
RECORDED_BYTES = 30_000
LEFT_BYTES = 50_000_000
"""What is left free on a full disk: less than the recorder keeps free."""
OWN = "/opt/virtual-devices"
"""Where the devices of the virtual vehicle lie on it: sources of their own, which no deployment touches."""
TREES = ("src", "tools")
RUN = f"""cd /opt/hindrax/.hindrax && . ./environment.sh
for package in {OWN}/src/hindrax_* {OWN}/tools; do PYTHONPATH=$package:$PYTHONPATH; done
exec env/bin/python -m hindrax_tools.virtual_vehicle.hardware
"""
DEVICES = f"""[Unit]
Description=emulated devices of the virtual vehicle
Before=hindrax.service
[Service]
ExecStartPre=-/sbin/modprobe fuse
ExecStart=/bin/sh {OWN}/run
Restart=always
ExecStopPost=/bin/sh -c 'umount -l /dev/i2c-1; rm -rf /dev/i2c-1 /dev/hindrax'
[Install]
WantedBy=multi-user.target
"""
ADAPTERS = {"dvl": ("gser", *ADAPTER), "stm32": ("acm", "0xf055", "0x9800")}
"""USB adapters by serial number: one that a rule names by that, and one that a rule of ours knows by its vendor."""
PLUG = (
    """set -e
echo 'SUBSYSTEM=="tty", ATTRS{serial}=="dvl", SYMLINK+="hindrax/usb_dvl"' >/etc/udev/rules.d/61-hindrax.rules
udevadm control --reload
cd /sys/kernel/config/usb_gadget
"""
    + "".join(
        f"""mkdir {name} && cd {name}
mkdir strings/0x409 configs/c.1 functions/{kind}.{name}
echo {vendor} >idVendor && echo {product} >idProduct && echo {name} >strings/0x409/serialnumber
ln -s functions/{kind}.{name} configs/c.1/ && echo dummy_udc.{number} >UDC && cd ..
"""
        for number, (name, (kind, vendor, product)) in enumerate(ADAPTERS.items())
    )
    + """mknod /dev/i2c-9 c 89 9 && chgrp i2c /dev/i2c-9 && chmod 660 /dev/i2c-9
sleep 1 && udevadm settle
"""
)
OPEN = f"""import os, pwd
with open("{CGROUP}/cgroup.procs", "w") as group:
    group.write(str(os.getpid()))
user = pwd.getpwnam("hindrax")
os.initgroups(user.pw_name, user.pw_gid)
os.setgid(user.pw_gid)
os.setuid(user.pw_uid)
for name in ("gpiochip0", "i2c-9", "hindrax/usb_dvl", "hindrax/thrusters", "ttyGS0"):
    try:
        os.close(os.open("/dev/" + name, os.O_RDWR | os.O_NONBLOCK | os.O_NOCTTY))
        print(name, "opened")
    except OSError as error:
        print(name, error.strerror)
"""
OPENED = [
    *("gpiochip0 opened", "i2c-9 No such device or address", "hindrax/usb_dvl opened", "hindrax/thrusters opened"),
    "ttyGS0 Operation not permitted",
]
"""No bus has the number 9, which is found out by whoever may open it."""
RATES = ("icm20948.divider:=44", "icm20948.period_s:=0.04", "navigator.rate_Hz:=25.0")
SLOW = f"""[Service]
ExecStart=
ExecStart=/opt/hindrax/hindrax up --record {" ".join(f"--set {rate}" for rate in RATES)}
"""
"""One core has the stack and the devices to run, and every system call of both passes through another process."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the outcome."""

    check: str
    good: bool | None
    """None: it was not run, and `figure` says why."""
    figure: str

    def line(self) -> str:
        """Return it as text."""
        return f"{ {True: 'good', False: 'BAD ', None: 'skip'}[self.good] }  {self.check:44}  {self.figure}"


@dataclass(slots=True)
class DeployedVehicle:
    """A machine that is on, and the clone that was deployed to it."""

    machine: Machine
    clone: Path
    cuts: int = 8
    seed: int = 1

    def deploy(self) -> tuple[int, str]:
        """Run the project's own command; returns its exit code and the last line of its stderr."""
        done = subprocess.run(  # noqa: S603  # our own words
            [str(self.clone / "hindrax"), "deploy", HOST],
            env=self.machine.environment(),
            capture_output=True,
            text=True,
            check=False,
            stdin=subprocess.DEVNULL,
        )
        return done.returncode, (done.stderr.strip().splitlines() or [""])[-1]

    def seen(self) -> list[Seen]:
        """What was on the wires since the power came on."""
        return seen_in(self.machine.witness())

    def runs(self) -> set[str]:
        """Names of the runs on the vehicle."""
        return set(self.machine.asked(f"sudo ls {RUNS} 2>/dev/null || true").split())

    def recording(self, before: set[str]) -> str:
        """Wait for a run that was not there before, and until it is recorded; returns its name."""
        found = ""

        def recorded() -> bool:
            nonlocal found
            found = max(self.runs() - before, default="")
            return bool(found) and self.recorded_bytes(found) > RECORDED_BYTES

        self.machine.until("a new run that is recorded", recorded)
        return found

    def recorded_bytes(self, run: str) -> int:
        """Size of the bag of a run."""
        return int(self.machine.asked(f"sudo sh -c 'cat {RUNS}/{run}/bag/*.mcap 2>/dev/null | wc -c'"))

    def health(self, wanted: Callable[[bool, str], bool] = lambda well, _: well) -> str:
        """Wait until `health` reports what is wanted; returns its sentence."""
        sentence = ""

        def matches() -> bool:
            nonlocal sentence
            done = self.machine.run(f"{HINDRAX} health")
            sentence = (done.stdout + done.stderr).strip()
            so = wanted(done.returncode == 0, sentence)
            if not so:
                # A busy host makes gaps in the velocities, after which the place is unknown until it is said again.
                if "pool_box" in sentence:
                    self.machine.run(f"{HINDRAX} recentre")
                self.wait(PAUSE_S)
            return so

        self.machine.until("health to say so", matches)
        return sentence

    def thrust(self) -> None:
        """Arm, push, and wait until it is on the wires. A wrench that comes late finds the thrusters disarmed again."""
        self.machine.run("sudo pkill -f '[h]indrax_cli.* wrench'")  # of an earlier check
        if not any(self._pushes() for _ in range(ATTEMPTS)):
            raise HindraxError(f"no thrust in {ATTEMPTS} attempts; {self.machine.folder / STARTED} says why")

    def _pushes(self) -> bool:
        """Arm and push once; whether it is on the wires before the commands end."""
        began = len(self.seen())

        def thrusts() -> bool:
            return any(one.thrust for one in self.seen()[began:])

        pilot = self.machine.start(f"{HINDRAX} arm && {HINDRAX} wrench 8 0 0 0 0 0 --for 600")
        self.machine.until("thrust", lambda: thrusts() or pilot.poll() is not None)
        return thrusts()

    def at(self, script: str) -> float:
        """Run a script there as root, and return the time of the monotonic clock just before it [s]."""
        return float(self.machine.asked(f"sudo sh -c 'cut -d \" \" -f 1 /proc/uptime; {script}'").split()[0])

    def wait(self, seconds: float) -> None:
        """Let time pass there."""
        until_s = self.seen()[-1].monotonic_s + seconds
        self.machine.until("time", lambda: self.seen()[-1].monotonic_s > until_s)

    def neutral(self, check: str, since_s: float) -> Finding:
        """Wait for neutral that stays until a stack is up again, and judge how long it took."""
        self.machine.until("neutral", lambda: not self.seen()[-1].thrust)
        self.wait(1.0)
        took_s = thrust_after_s(self.seen(), since_s)
        good = took_s is not None and took_s < NEUTRAL_S
        return Finding(check, good, "thrust for good" if took_s is None else f"neutral after {took_s:.2f} s")


def deployment(vehicle: DeployedVehicle) -> Iterator[Finding]:
    """Deploy onto a fresh machine with devices, and find the stack well."""
    machine = vehicle.machine
    began = time.monotonic()
    machine.power_on()
    machine.wait_for_login()
    up_s = machine.asked("cat /proc/uptime").split()[0]
    yield Finding("boot", good=True, figure=f"login after {up_s} s of the machine")
    for tree in TREES:
        machine.put_tree(vehicle.clone, tree, f"{OWN}/{tree}")
    machine.put(f"{OWN}/run", RUN)
    machine.put("/etc/systemd/system/virtual-devices.service", DEVICES)
    machine.put("/etc/systemd/system/hindrax.service.d/slow.conf", SLOW)
    machine.asked("sudo systemctl daemon-reload && sudo systemctl -q enable --now virtual-devices")
    machine.until("the devices", lambda: bool(vehicle.seen()))
    code, last = vehicle.deploy()
    yield Finding("deploy", code == 0, f"exit {code}, {last!r}, {time.monotonic() - began:.0f} s here")


def kills(vehicle: DeployedVehicle) -> Iterator[Finding]:
    """Kill all of the service, then the tool, with thrust on the wires; who judges is in another group.

    Neutral, and a stack that restarts, disarmed.
    """
    for what, script in (
        ("the whole service", f"echo 1 >{CGROUP}/cgroup.kill"),
        ("the main process", "kill -9 $(systemctl show -P MainPID hindrax)"),
    ):
        check, before = f"SIGKILL of {what}, armed", vehicle.runs()
        vehicle.thrust()
        killed_s = vehicle.at(script)
        yield vehicle.neutral(check, killed_s)
        vehicle.recording(before)
        sentence = vehicle.health()
        again = thrust_after_s(vehicle.seen(), killed_s)
        yield Finding(f"{check}: up again", again is not None and again < NEUTRAL_S, sentence)


def clock_steps(vehicle: DeployedVehicle) -> Iterator[Finding]:
    """Set the wall clock back and forward, with thrust and disarmed: neutral, and a new run with the reason."""
    for armed, way in ((True, "back"), (True, "forward"), (False, "back"), (False, "forward")):
        check, before = f"clock {way} by {STEP_S} s, {'armed' if armed else 'disarmed'}", vehicle.runs()
        if armed:
            vehicle.thrust()
        stepped_s = vehicle.at(f"date -s @$(( $(date +%s) {'-' if way == 'back' else '+'} {STEP_S} ))")
        if armed:
            yield vehicle.neutral(check, stepped_s)
        vehicle.recording(before)
        up_s = vehicle.seen()[-1].monotonic_s
        sentence = vehicle.machine.asked("sudo journalctl -u hindrax -n 200 -o cat | grep 'clock: the' | tail -1")
        yield Finding(f"{check}: a new run", f"set {way}" in sentence, f"after {up_s - stepped_s:.0f} s: {sentence}")
        vehicle.health()


def full_disk(vehicle: DeployedVehicle) -> Iterator[Finding]:
    """Fill the disk while it records, start on the full disk, and make room again."""
    machine = vehicle.machine
    pid = machine.asked("sudo systemctl show -P MainPID hindrax")
    room = f"$(( $(df --output=avail -B1 / | tail -1) - {LEFT_BYTES} ))"
    machine.asked(f"sudo fallocate -l {room} /var/fill")
    sentence = vehicle.health(wanted=lambda _, text: "recorder" in text)
    same = machine.asked("sudo systemctl show -P MainPID hindrax") == pid
    yield Finding("disk full while recording: goes on, says so", same, sentence)
    before = vehicle.runs()
    machine.asked("sudo systemctl restart hindrax")
    sentence = vehicle.health(wanted=lambda _, text: "recorder" in text and "heartbeat" not in text)
    restarts = machine.asked("sudo systemctl show -P NRestarts hindrax")
    yield Finding("start on a full disk: up, says so", restarts == "0", f"{restarts} restarts; {sentence}")
    machine.asked("sudo rm /var/fill")
    run = vehicle.recording(before)
    figure = f"{run}: {vehicle.recorded_bytes(run)} bytes; {vehicle.health()}"
    yield Finding("room again: it records", good=True, figure=figure)


def power_cuts(vehicle: DeployedVehicle) -> Iterator[Finding]:
    """Cut the power at random times while it records; the next boot completes the bag, and records."""
    rng = random.Random(vehicle.seed)  # noqa: S311  # no secret
    machine = vehicle.machine
    known: set[str] = set()
    run = max(vehicle.runs(), default="")
    for number in range(1, vehicle.cuts + 1):
        vehicle.wait(rng.uniform(0.5, 6.0))
        known = vehicle.runs()
        machine.cut_power()
        cut = vehicle.seen()[-1]
        machine.power_on()
        machine.wait_for_login()
        after = vehicle.recording(known)
        machine.until("the bag to be completed", lambda: "ended" in machine.asked(COMPLETION))
        bag = machine.folder / f"cut_{number}" / "bag"
        machine.fetch(f"{RUNS}/{run}/bag", bag)
        found = survey(bag)
        lost_s = cut.wall_s - found.last / NS_PER_S
        whole = not found.damage.unfinished and not found.damage.notes
        figure = f"{lost_s:.2f} s lost of {found.seconds + lost_s:.1f} s, {found.messages} messages; up by itself"
        yield Finding(f"power cut {number}", whole and lost_s < LOST_S, figure)
        run = after


COMPLETION = "pgrep -f [h]indrax_bag.read.recovery >/dev/null || echo ended"


def all_devices(vehicle: DeployedVehicle) -> Iterator[Finding]:
    """Fly a vehicle file with every kind of wire under the same unit: a leak, samples by edges, and the enable line."""
    machine = vehicle.machine
    if machine.run("test -d /sys/kernel/config/gpio-sim").returncode:
        yield Finding(
            "all devices", good=None, figure="this kernel simulates no GPIO chip; name one that does by --kernel"
        )
        return
    yield from _up_with(vehicle, timed=False)
    yield from _kinds(vehicle)
    yield from _data_ready(vehicle)
    yield from _off(vehicle, "enable line cut, armed", f"touch {FOLDER / CUT_ENABLE}", f"rm {FOLDER / CUT_ENABLE}")
    yield from _leak(vehicle)
    yield from _off(
        vehicle, "SIGKILL of the whole service, armed, enable line", f"echo 1 >{CGROUP}/cgroup.kill", "true"
    )
    yield from _up_with(vehicle, timed=True)
    freeze = f"echo %d >{CGROUP}/cgroup.freeze"
    yield from _off(vehicle, "the whole service frozen, armed, timer", freeze % 1, freeze % 0)


def _up_with(vehicle: DeployedVehicle, *, timed: bool) -> Iterator[Finding]:
    """Start devices and stack anew with the vehicle file of all devices."""
    machine = vehicle.machine
    machine.put(VEHICLE_FILE, yaml.safe_dump(every_device(timed=timed)))
    for unit in ("hindrax", "virtual-devices"):
        drop_in = f"[Service]\nEnvironment=HINDRAX_VEHICLE={VEHICLE_FILE}\n"
        machine.put(f"/etc/systemd/system/{unit}.service.d/vehicle.conf", drop_in)
    before = vehicle.runs()
    machine.asked(
        "sudo systemctl daemon-reload && sudo systemctl stop hindrax && sudo systemctl restart virtual-devices"
    )
    vehicle.wait(1.0)
    machine.asked("sudo systemctl start hindrax")
    vehicle.recording(before)
    sentence = vehicle.health()
    held = machine.asked(f"sudo -u hindrax /opt/hindrax/.hindrax/env/bin/python -c {shlex.quote(HELD_LINES)}")
    chip = machine.asked("stat -c '%A %U:%G' /dev/gpiochip0")
    figure = f"{held} lines of a chip that is {chip}; {sentence}"
    yield Finding(f"all devices: up, enable line {'with' if timed else 'without'} timer", held == "3", figure)


def _kinds(vehicle: DeployedVehicle) -> Iterator[Finding]:
    """Open a real device of each kind as the service does: in its group of processes, as its user.

    Ports of the emulated devices are ptys and their bus is a file, which no rule of the service is for.
    """
    vehicle.machine.put(f"{OWN}/plug", PLUG)
    vehicle.machine.put(f"{OWN}/open.py", OPEN)
    vehicle.machine.asked(f"sudo sh {OWN}/plug")
    opened = vehicle.machine.asked(f"sudo python3 {OWN}/open.py").splitlines()
    yield Finding("devices that the unit allows, and one it does not", opened == OPENED, "; ".join(opened))


def _leak(vehicle: DeployedVehicle) -> Iterator[Finding]:
    """Let water in, and out again: that there was water is told until the stack starts anew."""
    since_s = vehicle.at(f"touch {FOLDER / LEAK}")
    sentence = vehicle.health(wanted=lambda well, text: not well and "leak: found water" in text)
    told_s = vehicle.seen()[-1].monotonic_s - since_s
    vehicle.machine.asked(f"sudo rm {FOLDER / LEAK}")
    dry = vehicle.health(wanted=lambda well, text: not well and "dry again" in text)
    yield Finding("leak", good=True, figure=f"told within {told_s:.0f} s: {sentence}; then {dry}")


def _data_ready(vehicle: DeployedVehicle) -> Iterator[Finding]:
    """Cut the line that times the inertial samples, and mend it: what the driver says of it in the record."""
    machine, run = vehicle.machine, max(vehicle.runs())
    times_s = [vehicle.seen()[-1].wall_s]
    for script in ("touch", "rm"):
        vehicle.wait(HELD_S)
        times_s.append(vehicle.seen()[-1].wall_s)
        machine.asked(f"sudo {script} {FOLDER / CUT_READY}")
    vehicle.wait(HELD_S)
    times_s.append(vehicle.seen()[-1].wall_s)
    vehicle.wait(HELD_S)  # until it is recorded
    bag = machine.folder / "data_ready" / "bag"
    machine.fetch(f"{RUNS}/{run}/bag", bag)
    identity, silent = told_of_line(bag, [*times_s[:3], times_s[2] + SETTLED_S, times_s[3]])
    before, cut, after = silent[1] - silent[0], silent[2] - silent[1], silent[4] - silent[3]
    figure = f"{identity}; the line was silent {before} times before, {cut} while it was cut, {after} after"
    yield Finding("data-ready", "timed by line" in identity and 2 * max(before, after) < cut, figure)


def told_of_line(bag: Path, times_s: Sequence[float]) -> tuple[str, list[int]]:
    """Identity of the inertial sensor by /diagnostics, and how often its line was silent until each of these times."""
    identity, silent = "", [0] * len(times_s)
    key = f"rejected: {Rejected(Stamp(0), SILENT_LINE, b'').key}"
    for message in messages(bag, ["/diagnostics"]):
        for status in message.form.decode(message.data).status:
            if status.name.endswith("icm20948"):
                values = {one.key: one.value for one in status.values}
                identity = values.get("identity", identity)
                for index, time_s in enumerate(times_s):
                    if message.received <= time_s * NS_PER_S:
                        silent[index] = int(values.get(key, 0))
    return identity, silent


def _off(vehicle: DeployedVehicle, check: str, harm: str, mend: str) -> Iterator[Finding]:
    """Harm with thrust on the wires, and judge how soon the enable line has taken it off; then disarm."""
    vehicle.thrust()
    since_s = vehicle.at(harm)
    vehicle.wait(HELD_S)
    took_s = thrust_after_s(vehicle.seen(), since_s)
    good = took_s is not None and took_s < OFF_S
    figure = "thrust for good" if took_s is None else f"off after {took_s:.2f} s"
    vehicle.machine.asked(f"sudo sh -c {shlex.quote(mend)}")
    vehicle.machine.run(f"{HINDRAX} disarm")
    yield Finding(check, good, figure)


def no_device(vehicle: DeployedVehicle) -> Iterator[Finding]:
    """Deploy to a machine without any device: an honest end."""
    vehicle.machine.asked("sudo systemctl -q disable --now virtual-devices")
    code, last = vehicle.deploy()
    yield Finding("deploy without any device: refused", code == 1 and "failed" in last, f"exit {code}: {last}")


def every_device(*, timed: bool) -> dict[str, Any]:
    """The Hindrax with a device on every kind of wire that a vehicle file can name, as a vehicle file.

    What an ArduSub measures comes over a network, from another computer; only one sensor may measure the supply.
    """
    data: dict[str, Any] = yaml.safe_load(default_vehicle().read_text(encoding="utf-8"))
    optional, sensors = optional_sensors(), data["sensors"]
    sensors |= {name: optional[name] for name in ("a50", "bme280", "ina226", "sos_leak")}
    sensors["a50"] = sensors["a50"] | {"port": f"{TCP_PREFIX}//127.0.0.1:{SERVED}"}
    ahead = {"port": "/dev/hindrax/ping_ahead", "rotation_deg": [0.0, 90.0, 0.0], "position_m": [0.3, 0.0, 0.0]}
    sensors["ping_ahead"] = sensors["ping1d"] | ahead
    sensors["icm20948"]["data_ready"] = f"{CHIP}:22"
    data["output"] |= {"enable_line": f"{CHIP}:26", "enable_timer": timed}
    return data


CHECKS: dict[str, Callable[[DeployedVehicle], Iterator[Finding]]] = {
    "power-cuts": power_cuts,
    "clock-steps": clock_steps,
    "kills": kills,
    "full-disk": full_disk,
    "all-devices": all_devices,
    "no-device": no_device,
}
"""After the deployment, in this order; each leaves a stack that is up, but for the last."""
