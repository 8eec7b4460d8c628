"""The disk of the virtual vehicle: Debian, a kernel beside it, and the set-up of this commit, made once and kept.

The network of the machine ends at its host, so that nothing can be fetched there. The first set-up runs in the disk's
folder before it becomes a disk; a deployment then finds it done.
"""

import hashlib
import os
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hindrax_core.errors import HindraxError

TOOLS = {name: name for name in ("mmdebstrap", "patchelf", "git")}
TOOLS |= {"mke2fs": "e2fsprogs", "ip": "iproute2", "nsenter": "util-linux", "ssh": "openssh-client"}
"""Programs that are needed here, and the Debian packages that bring them."""
DEBIAN = "bookworm"
PACKAGES = (
    *("systemd-sysv", "udev", "kmod", "procps", "iproute2", "sudo"),
    *("openssh-server", "ca-certificates", "python3", "python3-venv", "python3-dev", "g++"),
)
KERNEL_DEBIAN, KERNEL_MIRROR = "forky", "deb http://deb.debian.org/debian forky main"
"""Where User-mode Linux comes from: 7.2; that of older releases knows no seccomp. It runs on a C library of its own."""
KERNEL, MODULES, LIBRARIES = "usr/bin/linux.uml", "usr/lib/uml/modules", "usr/lib/x86_64-linux-gnu"
ADDRESS, FIRST_DATE, NO_CLOCK = "10.0.2.15", "2020-01-01", "/usr/sbin/no-clock"
DISK_SIZE = "8G"
CLONE, USER, USER_ID = "opt/hindrax", "pilot", 1000
BUILD_INPUTS = ("setup", "src/*/package.xml", "src/*/setup.py", "src/*/setup.cfg", "src/hindrax_msgs")
"""Paths whose change makes another set-up, so another image."""
CERTIFICATES = "etc/ssl/certs/ca-certificates.crt"
FILES = {
    "etc/hostname": "vehicle\n",
    "etc/hosts": "127.0.0.1 localhost vehicle\n",
    "etc/fstab": "/dev/ubda / ext4 errors=remount-ro 0 1\n",
    "etc/systemd/network/ether.network": f"[Match]\nName=vec*\n[Network]\nAddress={ADDRESS}/24\n",
    "etc/sudoers.d/pilot": f"{USER} ALL=(ALL) NOPASSWD: ALL\n",
    # Names of addresses are asked for at every login, and nothing answers here.
    "etc/ssh/sshd_config.d/vehicle.conf": "UseDNS no\nUsePAM no\n",
    # No battery clock: every boot begins at the same time, long ago.
    NO_CLOCK[1:]: f"#!/bin/sh\ndate --set {FIRST_DATE} >/dev/null\nexec /sbin/init\n",
}
UNUSED = ("apt-daily.timer", "apt-daily-upgrade.timer", "dpkg-db-backup.timer", "e2scrub_all.timer", "fstrim.timer")


@dataclass(frozen=True, slots=True)
class Image:
    """What a machine boots from. The disk is never written: each machine has a copy of its own."""

    disk: Path
    kernel: Path
    key: Path
    """Private key of the user `USER`."""


def missing_packages() -> list[str]:
    """Debian packages whose programs are not on this machine."""
    return [package for tool, package in TOOLS.items() if shutil.which(tool) is None]


def identity(listing: str) -> str:
    """Name of an image: of its packages, of what is written to it, and of `git ls-tree` of BUILD_INPUTS."""
    content = f"{DEBIAN} {KERNEL_DEBIAN} {PACKAGES} {DISK_SIZE} {FILES} {UNUSED} {listing}"
    return hashlib.sha256(content.encode()).hexdigest()[:12]


def image_of(clone: Path, cache: Path, report: Callable[[str], None]) -> Image:
    """The image of the last commit of a clone, made unless it is in the cache. Root only where it has to be made."""
    files = _run("git", "ls-files", *BUILD_INPUTS, cwd=clone).split()
    folder = cache.resolve() / identity(_run("git", "ls-tree", "-r", "HEAD", *files, cwd=clone))
    image = Image(folder / "disk.ext4", folder / "kernel" / KERNEL, folder / "key")
    if not image.disk.exists():
        _make(image, clone, report)
    return image


def _make(image: Image, clone: Path, report: Callable[[str], None]) -> None:
    if os.geteuid():
        raise HindraxError("the image is not in the cache and only root can make it: owners of files, and chroot")
    folder = image.disk.parent
    root = folder / "root"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    _run("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(image.key))
    report(f"unpacking Debian {DEBIAN} into {root}, and its kernel")
    _run("mmdebstrap", "--variant=minbase", f"--include={','.join(PACKAGES)}", DEBIAN, str(root))
    _unpack_kernel(image.kernel, root)
    report("setting hindrax up in it")
    _configure(root, image.key.with_suffix(".pub").read_text(encoding="ascii"))
    _set_up(root, clone)
    report("writing the disk")
    unfinished = image.disk.with_suffix(".unfinished")
    _run("mke2fs", "-q", "-t", "ext4", "-d", str(root), str(unfinished), DISK_SIZE)
    unfinished.rename(image.disk)
    shutil.rmtree(root)


def _unpack_kernel(kernel: Path, root: Path) -> None:
    """Fetch the kernel with its C library, whatever C library this machine has; its modules go to the disk."""
    unpacked = kernel.parents[2]
    lagging = 'Acquire::Check-Valid-Until "false"'  # a mirror of a release that is not out yet may be weeks old
    release = [KERNEL_DEBIAN, str(unpacked), KERNEL_MIRROR]
    _run("mmdebstrap", "--variant=extract", "--include=user-mode-linux", f"--aptopt={lagging}", *release)
    loader = unpacked / LIBRARIES / "ld-linux-x86-64.so.2"
    _run("patchelf", "--set-interpreter", str(loader), "--set-rpath", str(unpacked / LIBRARIES), str(kernel))
    _run("cp", "-a", f"{unpacked / MODULES}/.", str(root / "usr/lib/modules"))


def _configure(root: Path, public_key: str) -> None:
    useradd = f"useradd --create-home --password * --shell /bin/bash --uid {USER_ID} {USER}"
    _run("chroot", str(root), *useradd.split())
    home = f"home/{USER}/.ssh"
    for name, text in {**FILES, f"{home}/authorized_keys": public_key}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="ascii")
    _run("chown", "-R", f"{USER_ID}:{USER_ID}", str(root / home))
    _run("chroot", str(root), "systemctl", "--quiet", "enable", "systemd-networkd", "ssh")
    _run("chroot", str(root), "systemctl", "--quiet", "mask", *UNUSED)
    (root / NO_CLOCK[1:]).chmod(0o755)


def _set_up(root: Path, clone: Path) -> None:
    """Run the set-up of a vehicle in the folder, as its user, with this machine's settings of the package index."""
    place = root / CLONE
    place.mkdir(parents=True)
    with subprocess.Popen(["git", "archive", "HEAD"], cwd=clone, stdout=subprocess.PIPE) as archive:  # noqa: S607  # the user's git
        subprocess.run(["tar", "-x", "-C", place], stdin=archive.stdout, check=True)  # noqa: S603, S607  # our own words
    _run("chown", "-R", f"{USER_ID}:{USER_ID}", str(place))
    (root / "dev/shm").chmod(0o1777)  # for compilers that work side by side
    for name in ("etc/resolv.conf", CERTIFICATES):
        shutil.copyfile(Path("/") / name, root / name)
    settings = [f"{key}={value}" for key, value in os.environ.items() if _of_the_index(key)]
    as_user = ["setpriv", f"--reuid={USER_ID}", f"--regid={USER_ID}", "--clear-groups", "env", "-i", *settings]
    as_user += [f"HOME=/home/{USER}", "PATH=/usr/bin:/bin", f"SSL_CERT_FILE=/{CERTIFICATES}"]
    _run("mount", "-t", "proc", "proc", str(root / "proc"))
    try:
        _run("chroot", str(root), *as_user, f"/{CLONE}/hindrax", "setup", "--vehicle")
    finally:
        _run("umount", str(root / "proc"))
    (root / "etc/resolv.conf").unlink()


def _of_the_index(key: str) -> bool:
    if key.endswith("_CACHE_DIR"):  # a folder of this machine
        return False
    return key.startswith(("PIP_", "UV_")) or key.lower() in ("http_proxy", "https_proxy", "all_proxy", "no_proxy")


def _run(*words: str, cwd: Path | None = None) -> str:
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)  # noqa: S603  # our own words
    if done.returncode:
        last = "\n".join((done.stderr or done.stdout).strip().splitlines()[-5:])
        raise HindraxError(f"{words[0]} ended with code {done.returncode}: {last}")
    return done.stdout
