"""The virtual machine: qemu, reached by ssh on loopback, its power cut by killing qemu.

With KVM it has two cores of this machine, and its seconds are ours. Without, its time is that of its processor: an
instruction takes a nanosecond (`-icount`), however busy this machine is. So it is a vehicle with one slow core whose
deadlines mean something, and every figure is in its seconds.
"""

from __future__ import annotations

import os
import shlex
import socket
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any, Self

from hindrax_core.errors import HindraxError
from hindrax_tools.virtual_vehicle.image import USER, Image

HOST = "vehicle"
DISK, WITNESS = "overlay.qcow2", "witness.log"
BOOT_S, LONGEST_S = 900.0, 900.0
"""Longest wait for a login, and longest script, in seconds of this machine. With KVM a fifth is enough."""
KERNEL_WORDS = "root=/dev/vda rw console=ttyS0 quiet mitigations=off nokaslr tsc=reliable random.trust_cpu=on"
FIRST_DATE = "2020-01-01T00:00:00"
"""No battery clock: every boot begins at the same time, long ago."""
QEMU = "qemu-system-x86_64"
KVM = {
    "accel": "kvm",
    "cpu": "host,-arch-capabilities",  # a KVM inside of another one offers capabilities that it then refuses
    "smp": "2",
}
EMULATION = {
    "accel": "tcg",
    "icount": "shift=0",
    "cpu": "Nehalem",  # wheels want SSE4; emulated AVX is slower than none
    "smp": "1",
}
COMMON = {"machine": "q35", "m": "2048", "display": "none", "monitor": "none"}

KVM_TRY_S = 15.0
"""Within this time a kernel says its first word, where KVM executes it and does not interpret it."""


def kvm_works(image: Image, console: Path, options: Mapping[str, str] = MappingProxyType(KVM)) -> bool:
    """Whether KVM takes our machine and runs its kernel: some open /dev/kvm and then hang, in a machine of a cloud."""
    words = {**options, **COMMON, "kernel": str(image.kernel), "append": "console=ttyS0", "serial": f"file:{console}"}
    with console.with_suffix(".log").open("ab") as log:
        qemu = _started([QEMU, "-nodefaults", *_words(words)], log)
        deadline = time.monotonic() + KVM_TRY_S
        heard = False
        while not heard and qemu.poll() is None and time.monotonic() < deadline:
            time.sleep(0.1)
            heard = console.exists() and b"Linux version" in console.read_bytes()
        qemu.kill()
        qemu.wait()
    return heard


def free_port() -> int:
    """A port on loopback that nobody uses now."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


@dataclass(slots=True)
class Machine:
    """One machine with a disk of its own in a folder. Use it as a context manager: it then ends with the tool."""

    image: Image
    folder: Path
    kvm: bool = False
    port: int = field(default_factory=free_port)
    _qemu: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        self.folder.mkdir(parents=True, exist_ok=True)
        base = ["-b", str(self.image.disk), "-F", "raw", str(self.folder / DISK)]
        _call(["qemu-img", "create", "-q", "-f", "qcow2", *base], check=True)
        config, wrapper = self.folder / "ssh_config", self.folder / "bin/ssh"
        config.write_text(ssh_config(self.image.key, self.port, self.folder), encoding="ascii")
        wrapper.parent.mkdir()
        wrapper.write_text(f'#!/bin/sh\nexec /usr/bin/ssh -F {config} "$@"\n', encoding="ascii")
        wrapper.chmod(0o755)
        return self

    def __exit__(self, *_: object) -> None:
        self.cut_power()

    @property
    def processor(self) -> str:
        """What runs its instructions, for a person."""
        return "KVM, two cores of this machine" if self.kvm else "emulated, one core of 1e9 instructions/s"

    def power_on(self) -> None:
        """Start the machine; it boots by itself."""
        words = qemu_words(self.image, self.folder, self.port, kvm=self.kvm)
        self._qemu = _started(words, self._log("qemu.log"))

    def cut_power(self) -> None:
        """Kill the machine in the midst of what it does."""
        if self._qemu is not None:
            self._qemu.kill()
            self._qemu.wait()
            self._qemu = None
        _call([*self._ssh, "-O", "exit", HOST], capture_output=True)

    def wait_for_login(self) -> None:
        """Wait until ssh answers."""
        self.until("a login", lambda: self.run("true").returncode == 0, BOOT_S)

    def until(self, what: str, seen: Callable[[], bool], seconds: float = LONGEST_S) -> None:
        """Wait for something, in seconds of this machine. HindraxError when it does not come, or the machine ends."""
        seconds /= 5.0 if self.kvm else 1.0
        deadline = time.monotonic() + seconds
        while not seen():
            if self._qemu is None or self._qemu.poll() is not None:
                raise HindraxError(f"qemu has ended; {self.folder / 'qemu.log'} says why")
            if time.monotonic() > deadline:
                raise HindraxError(f"waited {seconds:.0f} s in vain for {what}")
            time.sleep(0.2 if self.kvm else 2.0)

    def run(self, script: str) -> subprocess.CompletedProcess[str]:
        """Run a script there, and wait for its end."""
        nothing = subprocess.DEVNULL
        try:
            return _call([*self._ssh, HOST, script], capture_output=True, text=True, timeout=LONGEST_S, stdin=nothing)
        except subprocess.TimeoutExpired:
            return subprocess.CompletedProcess(script, 124, "", f"no end within {LONGEST_S:.0f} s")

    def asked(self, script: str) -> str:
        """What a script says. HindraxError when it fails."""
        done = self.run(script)
        if done.returncode:
            raise HindraxError(f"{script.splitlines()[0]}: code {done.returncode}; {done.stderr.strip()[-300:]}")
        return done.stdout.strip()

    def start(self, script: str) -> None:
        """Start a script there; what it says goes to a log."""
        _started([*self._ssh, HOST, script], self._log("started.log"))

    def put(self, name: str, text: str) -> None:
        """Write a file there, as root."""
        script = f"sudo mkdir -p {shlex.quote(str(Path(name).parent))} && sudo tee {shlex.quote(name)} >/dev/null"
        _call([*self._ssh, HOST, script], input=text, text=True, check=True)

    def fetch(self, folder: str, target: Path) -> None:
        """Copy the files of a folder there into a new one here."""
        target.mkdir(parents=True)
        packed = _call([*self._ssh, HOST, f"sudo tar -c -C {folder} ."], capture_output=True, check=True)
        _call(["tar", "-x", "-C", str(target)], input=packed.stdout, check=True)

    def witness(self) -> list[str]:
        """What the emulated devices wrote to their serial line, since the power came on. It outlives the machine."""
        return (self.folder / WITNESS).read_text(encoding="ascii", errors="replace").splitlines()

    def environment(self) -> dict[str, str]:
        """Environment in which a plain `ssh vehicle` reaches the machine: what `deploy` calls."""
        path = f"{self.folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
        return os.environ | {"PATH": path, "HINDRAX_RUNTIME_DIR": str(self.folder)}

    @property
    def _ssh(self) -> list[str]:
        return ["ssh", "-F", str(self.folder / "ssh_config")]

    def _log(self, name: str) -> IO[bytes]:
        return (self.folder / name).open("ab")


def _call(words: Sequence[str], **options: Any) -> subprocess.CompletedProcess[Any]:
    return subprocess.run(words, **{"check": False, **options})  # noqa: S603, PLW1510  # our own words


def _started(words: Sequence[str], log: IO[bytes]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=log, stderr=log)  # noqa: S603  # our own words


def qemu_words(image: Image, folder: Path, port: int, *, kvm: bool) -> list[str]:
    """Return the machine as qemu takes it: one disk, a network that ends at a port on loopback."""
    options = {
        **(KVM if kvm else EMULATION),
        **COMMON,
        "rtc": f"base={FIRST_DATE},clock=vm",
        "kernel": str(image.kernel),
        "initrd": str(image.initrd),
        "append": KERNEL_WORDS,
        "drive": f"file={folder / DISK},if=virtio,format=qcow2",
        "nic": f"user,model=virtio-net-pci,restrict=on,hostfwd=tcp:127.0.0.1:{port}-:22",
    }
    serial = ["-serial", f"file:{folder / 'console.log'}", "-serial", f"file:{folder / WITNESS}"]
    return [QEMU, "-nodefaults", "-no-reboot", "-device", "virtio-rng-pci", *_words(options), *serial]


def _words(options: Mapping[str, str]) -> list[str]:
    return [word for name, value in options.items() for word in (f"-{name}", value)]


def ssh_config(key: Path, port: int, folder: Path) -> str:
    """Return the settings of ssh: only this machine, only this key, one connection for all."""
    return f"""Host {HOST}
  HostName 127.0.0.1
  Port {port}
  User {USER}
  IdentityFile {key}
  IdentitiesOnly yes
  StrictHostKeyChecking no
  UserKnownHostsFile /dev/null
  LogLevel ERROR
  ConnectTimeout 60
  ControlMaster auto
  ControlPersist 3600
  ControlPath {folder}/ssh-%C
"""
