"""The parts of the virtual vehicle that need no machine."""

from __future__ import annotations

from pathlib import Path

import pytest

from hindrax_tools.virtual_vehicle import image, machine
from hindrax_tools.virtual_vehicle.evidence import Finding, seen_in, thrust_after_s
from hindrax_tools.virtual_vehicle.image import Image, identity, missing_packages
from hindrax_tools.virtual_vehicle.machine import kvm_works, qemu_words, ssh_config

IMAGE = Image(*map(Path, ("disk", "kernel", "initrd", "key")))
LINES = ["1000.0 10.0 neutral", "1000.1 10.1 thrust", "1000.2 10.2 thrust", "1000.3 10.3 neutral", "1000.4 10.4 neut"]


def test_the_last_line_of_the_witness_may_be_cut_off() -> None:
    assert [one.monotonic_s for one in seen_in(LINES)] == [10.0, 10.1, 10.2, 10.3]


def test_thrust_lasts_until_the_first_neutral_that_stays() -> None:
    seen = seen_in(LINES)
    assert thrust_after_s(seen, 10.1) == pytest.approx(0.2)
    assert thrust_after_s(seen, 10.3) == 0.0
    again = [*LINES[:4], "1000.5 10.5 thrust", "1000.6 10.6 neutral"]
    assert thrust_after_s(seen_in(again), 10.1) == pytest.approx(0.5)


def test_thrust_that_does_not_end_and_a_silent_witness_are_no_neutral() -> None:
    assert thrust_after_s(seen_in(LINES[:3]), 10.0) is None
    assert thrust_after_s(seen_in(LINES), 99.0) is None


def test_a_finding_is_one_line() -> None:
    assert Finding("boot", good=False, figure="never").line().split() == ["BAD", "boot", "never"]


def test_what_is_missing_is_named_by_its_debian_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(image.shutil, "which", lambda tool: None if tool.startswith("qemu") else tool)
    assert missing_packages() == ["qemu-system-x86", "qemu-utils"]


def test_another_set_up_is_another_image() -> None:
    assert identity("one") == identity("one") != identity("other")


def test_nobody_but_this_machine_reaches_the_vehicle_and_it_reaches_nobody() -> None:
    words = " ".join(qemu_words(IMAGE, Path("/f"), 2222, kvm=True))
    assert "restrict=on,hostfwd=tcp:127.0.0.1:2222-:22" in words
    assert "HostName 127.0.0.1" in ssh_config(Path("key"), 2222, Path("/f"))


def test_only_an_emulated_machine_has_the_time_of_its_instructions() -> None:
    assert "-icount" in qemu_words(IMAGE, Path("/f"), 2222, kvm=False)
    assert "-icount" not in qemu_words(IMAGE, Path("/f"), 2222, kvm=True)
    assert "kvm" not in qemu_words(IMAGE, Path("/f"), 2222, kvm=False)


@pytest.mark.parametrize(("does", "works"), [("printf 'Linux version 6'", True), ("exit 1", False), ("sleep 9", False)])
def test_kvm_is_used_where_a_kernel_speaks(
    does: str, works: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    qemu = tmp_path / "qemu"
    qemu.write_text(f'#!/bin/sh\nfor word; do :; done\nexec >"${{word#file:}}"\n{does}\n[ $? = 0 ] && exec sleep 9\n')
    qemu.chmod(0o755)
    monkeypatch.setattr(machine, "QEMU", str(qemu))
    monkeypatch.setattr(machine, "KVM_TRY_S", 1.0)
    assert kvm_works(IMAGE, tmp_path / "console") is works
