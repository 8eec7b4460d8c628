"""The virtual machine: User-mode Linux in a network of its own, its power cut by killing it.

A kernel that is a process: no hypervisor is needed, and its processes run at the speed of one core of this machine, in
seconds of this machine. Since Linux 6.16 their system calls are caught by seccomp; before, each was traced, which takes
ten times as long.
"""

import contextlib
import os
import shlex
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Self

from hindrax_core.errors import HindraxError
from hindrax_tools.virtual_vehicle.image import ADDRESS, NO_CLOCK, USER, Image

HOST = "vehicle"
DISK, WITNESS, CONSOLE, MESSAGES, PID = "disk.ext4", "witness.log", "console.log", "kernel.log", "pid"
STARTED = "started.log"
"""Output of scripts that run in the background."""
BOOT_S, LONGEST_S = 90.0, 240.0
"""Longest wait for a login, and longest script."""
ADAPTER = ("0x0403", "0x6001")
"""Vendor and product of a USB adapter that becomes a /dev/ttyUSB*."""
SHOWN = 600
"""Letters of what a kernel said before it ended."""
KERNEL_WORDS = (
    *("mem=2048M", "seccomp=on", "root=/dev/ubda", "rw", f"init={NO_CLOCK}", "quiet"),
    *("console=tty0", "con=null", "ssl=null"),
    # Of a kernel that simulates USB: sockets, and the adapter that is no modem. Others ignore them.
    *(
        "dummy_hcd.num=2",
        f"usbserial.vendor={ADAPTER[0]}",
        f"usbserial.product={ADAPTER[1]}",
        "i2c_stub.chip_addr=0x40",
    ),
)
NETWORK = """ip link set lo up
ip tuntap add mode tap name vehicle
ip address add 10.0.2.2/24 dev vehicle
ip link set vehicle up gso_max_segs 1
exec "$@"
"""
"""What runs in the network of the machine before its kernel does; nothing else is in that network."""
SSH_CONFIG = f"""Host {HOST}
  HostName {ADDRESS}
  User {USER}
  IdentityFile {{key}}
  IdentitiesOnly yes
  StrictHostKeyChecking no
  UserKnownHostsFile /dev/null
  LogLevel ERROR
  ConnectTimeout 5
  ControlMaster auto
  ControlPersist 3600
  ControlPath {{folder}}/ssh-%C
"""
"""Settings of ssh: only this machine, only this key, one connection for all."""


@dataclass(slots=True)
class Machine:
    """One machine with a disk of its own in a folder. Use it as a context manager: it then ends with the tool."""

    image: Image
    folder: Path
    _kernel: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        self.folder.mkdir(parents=True, exist_ok=True)
        _call(["cp", "--sparse=always", "--reflink=auto", str(self.image.disk), str(self.folder / DISK)], check=True)
        config = self.folder / "ssh_config"
        config.write_text(SSH_CONFIG.format(key=self.image.key, folder=self.folder), encoding="ascii")
        self._ssh.parent.mkdir()
        # An ssh that starts in the network of the machine.
        network = f'nsenter --target "$(cat {self.folder / PID})" --user --net --preserve-credentials'
        self._ssh.write_text(f'#!/bin/sh\nexec {network} /usr/bin/ssh -F {config} "$@"\n', encoding="ascii")
        self._ssh.chmod(0o755)
        return self

    def __exit__(self, *_: object) -> None:
        self.cut_power()

    def power_on(self) -> None:
        """Start the machine; it boots."""
        line = (self.folder / WITNESS).open("wb")
        with line as witness, self._log(CONSOLE) as console, self._log(MESSAGES) as messages:
            wires = (console.fileno(), witness.fileno())
            words = kernel_words(self.image, self.folder / DISK, *wires)
            self._kernel = _started(words, messages, pass_fds=wires, start_new_session=True)
        (self.folder / PID).write_text(str(self._kernel.pid), encoding="ascii")

    def cut_power(self) -> None:
        """Kill the machine in the midst of what it does: the kernel, and all that it runs."""
        if self._kernel is not None:
            with contextlib.suppress(ProcessLookupError):  # it has ended by itself
                os.killpg(self._kernel.pid, signal.SIGKILL)
            self._kernel.wait()
            self._kernel = None
        _call(["ssh", "-F", str(self.folder / "ssh_config"), "-O", "exit", HOST], capture_output=True)

    def wait_for_login(self) -> None:
        """Wait until ssh answers."""
        self.until("a login", lambda: self.run("true").returncode == 0, BOOT_S)

    def until(self, what: str, seen: Callable[[], bool], seconds: float = LONGEST_S) -> None:
        """Wait for something, in seconds of this machine. HindraxError when it does not come, or the machine ends."""
        deadline = time.monotonic() + seconds
        while not seen():
            if self._kernel is None or self._kernel.poll() is not None:
                said = (self.folder / MESSAGES).read_text(encoding="utf-8", errors="replace").strip()[-SHOWN:]
                raise HindraxError(f"the machine has ended; its last words: {said or 'none'}")
            if time.monotonic() > deadline:
                raise HindraxError(f"waited {seconds:.0f} s in vain for {what}")
            time.sleep(0.2)

    def run(self, script: str) -> subprocess.CompletedProcess[str]:
        """Run a script there, and wait for its end."""
        options: dict[str, object] = {"timeout": LONGEST_S, "stdin": subprocess.DEVNULL}
        try:
            return _call([str(self._ssh), HOST, script], capture_output=True, text=True, **options)
        except subprocess.TimeoutExpired:
            return subprocess.CompletedProcess(script, 124, "", f"no end within {LONGEST_S:.0f} s")

    def asked(self, script: str) -> str:
        """Output of a script. HindraxError when it fails."""
        done = self.run(script)
        if done.returncode:
            raise HindraxError(f"{script.splitlines()[0]}: code {done.returncode}; {done.stderr.strip()[-300:]}")
        return done.stdout.strip()

    def start(self, script: str) -> subprocess.Popen[bytes]:
        """Start a script there; its output goes to a log."""
        return _started([str(self._ssh), HOST, script], self._log(STARTED))

    def put(self, name: str, text: str) -> None:
        """Write a file there, as root."""
        script = f"sudo mkdir -p {shlex.quote(str(Path(name).parent))} && sudo tee {shlex.quote(name)} >/dev/null"
        _call([str(self._ssh), HOST, script], input=text, text=True, check=True)

    def put_tree(self, clone: Path, tree: str, folder: str) -> None:
        """Write the files of a folder of the last commit of a clone there, as root."""
        packed = _call(["git", "-C", str(clone), "archive", f"HEAD:{tree}"], capture_output=True, check=True)
        unpack = f"sudo mkdir -p {folder} && sudo tar -x --touch -C {folder}"
        _call([str(self._ssh), HOST, unpack], input=packed.stdout, check=True)

    def fetch(self, folder: str, target: Path) -> None:
        """Copy the files of a folder there into a new one here."""
        target.mkdir(parents=True)
        packed = _call([str(self._ssh), HOST, f"sudo tar -c -C {folder} ."], capture_output=True, check=True)
        _call(["tar", "-x", "-C", str(target)], input=packed.stdout, check=True)

    def witness(self) -> list[str]:
        """What the emulated devices wrote to their serial line, since the power came on. It outlives the machine."""
        return (self.folder / WITNESS).read_text(encoding="ascii", errors="replace").splitlines()

    def environment(self) -> dict[str, str]:
        """Environment in which a plain `ssh vehicle` reaches the machine: what `deploy` calls."""
        path = f"{self._ssh.parent}{os.pathsep}{os.environ['PATH']}"
        return os.environ | {"PATH": path, "HINDRAX_RUNTIME_DIR": str(self.folder)}

    @property
    def _ssh(self) -> Path:
        return self.folder / "bin/ssh"

    def _log(self, name: str) -> IO[bytes]:
        return (self.folder / name).open("ab")


def _call(words: Sequence[str], **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, **{"check": False, **options})  # noqa: S603, PLW1510  # our own words


def _started(words: Sequence[str], log: IO[bytes], **options: Any) -> subprocess.Popen[bytes]:
    return subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=log, stderr=log, **options)  # noqa: S603  # our own words


def kernel_words(image: Image, disk: Path, console: int, witness: int) -> list[str]:
    """Return the machine as a command: one disk, two serial lines into open files, a network that ends right here.

    It has one core, and its processes follow each other faster when that is always the same one of this machine.
    """
    network = ["unshare", "--user", "--map-root-user", "--net", "sh", "-c", NETWORK, "sh"]
    core = ["taskset", "--cpu-list", str(max(os.sched_getaffinity(0)))]
    network += ["setpriv", "--pdeathsig", "KILL", *core]  # it never outlives this tool
    lines = [f"con0=null,fd:{console}", f"ssl1=null,fd:{witness}"]
    return [*network, str(image.kernel), *KERNEL_WORDS, *lines, f"ubd0={disk}", "vec0:transport=tap,ifname=vehicle"]
