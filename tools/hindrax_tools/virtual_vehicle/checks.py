"""What the virtual vehicle has to survive, each check with its findings. Times are those of the machine."""

import random
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hindrax_bag.read.survey import survey
from hindrax_core.errors import HindraxError
from hindrax_core.events import NS_PER_S
from hindrax_tools.virtual_vehicle.hardware import Seen, seen_in, thrust_after_s
from hindrax_tools.virtual_vehicle.machine import HOST, STARTED, Machine

RUNS = "/var/lib/hindrax/runs"
HINDRAX = "cd /tmp && sudo -u hindrax HINDRAX_RUNTIME_DIR=/run/hindrax /opt/hindrax/hindrax"
CGROUP = "/sys/fs/cgroup/system.slice/hindrax.service"
NEUTRAL_S, LOST_S, STEP_S = 15.0, 2.0, 3600
"""Until neutral by a new process, at most; what a power cut may lose; a step."""
PAUSE_S = 2.0
"""Between two questions for the health: each takes a second of an emulated processor, from the stack that starts."""
ATTEMPTS = 3
RECORDED_BYTES = 30_000
LEFT_BYTES = 50_000_000
"""What is left free on a full disk: less than the recorder keeps free."""
DEVICES = """[Unit]
Description=emulated devices of the virtual vehicle
Before=hindrax.service
[Service]
ExecStartPre=/sbin/modprobe fuse
WorkingDirectory=/opt/hindrax/.hindrax
ExecStart=/bin/sh -c '. ./environment.sh; exec env/bin/python /opt/virtual-devices/hardware.py'
Restart=always
ExecStopPost=/bin/sh -c 'umount -l /dev/i2c-1; rm -rf /dev/i2c-1 /dev/hindrax'
[Install]
WantedBy=multi-user.target
"""
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
    good: bool
    figure: str

    def line(self) -> str:
        """Return it as text."""
        return f"{'good' if self.good else 'BAD '}  {self.check:44}  {self.figure}"


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
    machine.put("/opt/virtual-devices/hardware.py", Path(__file__).with_name("hardware.py").read_text(encoding="utf-8"))
    machine.put("/etc/systemd/system/virtual-devices.service", DEVICES)
    machine.put("/etc/systemd/system/hindrax.service.d/slow.conf", SLOW)
    machine.asked("sudo systemctl daemon-reload && sudo systemctl -q enable --now virtual-devices")
    # A deployment replaces links that their imports go through.
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


def no_device(vehicle: DeployedVehicle) -> Iterator[Finding]:
    """Deploy to a machine without any device: an honest end."""
    vehicle.machine.asked("sudo systemctl -q disable --now virtual-devices")
    code, last = vehicle.deploy()
    yield Finding("deploy without any device: refused", code == 1 and "failed" in last, f"exit {code}: {last}")


CHECKS: dict[str, Callable[[DeployedVehicle], Iterator[Finding]]] = {
    "power-cuts": power_cuts,
    "clock-steps": clock_steps,
    "kills": kills,
    "full-disk": full_disk,
    "no-device": no_device,
}
"""After the deployment, in this order; each leaves a stack that is up, but for the last."""
