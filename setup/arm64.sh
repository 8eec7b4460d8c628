#!/bin/sh
# Tests on aarch64, under qemu-user, what runs without ROS: devices, dead man, output, recorder, identification. A processor that
# is emulated says nothing of speed. `setup/arm64.sh` runs all; `setup/arm64.sh PATH...` these tests, as pytest.
# Needs qemu-user-static and mmdebstrap (with debian-archive-keyring on Ubuntu); no root, no binfmt. Everything else goes into
# $HINDRAX_ARM64 (.hindrax/arm64): a root unpacked from Debian packages of arm64, and wheels of that platform.
set -eu
cd "$(dirname "$0")/.."
place=${HINDRAX_ARM64:-.hindrax/arm64}
uv=.hindrax/bootstrap/bin/uv
[ -x "$uv" ] || { echo "setup/arm64.sh: found no $uv, wanted hindrax set up; run ./hindrax setup" >&2 && exit 1; }
mkdir -p "$place"

# The lock of the vehicle computer, whose file names no platform: every pin must have a wheel for it, but the two that are built.
"$uv" pip install --quiet --dry-run --target "$place/lock" --python-platform aarch64-manylinux_2_39 --python-version 3.12 \
  --only-binary :all: --no-binary empy --no-binary padasip --no-deps --require-hashes --requirements setup/native.lock

[ -d "$place/root" ] || {
  rm -rf "$place/root.part"
  mmdebstrap --quiet --variant=extract --architectures=arm64 --include=python3,python3-distutils,libstdc++6 \
    bookworm "$place/root.part"
  # Made by root, it has device files, which qemu would open instead of those of this machine: a pty then is none.
  rm -rf "$place/root.part/dev"
  mv "$place/root.part" "$place/root"
}
"$uv" pip install --quiet --target "$place/site" --python-platform aarch64-manylinux_2_36 --python-version 3.11 \
  --only-binary :all: --requirements setup/runtime.in pytest==7.4.4 hypothesis psutil pymavlink rosbags

# A copy of the packages alone: nothing of the clone around them is imported, and no test needs it.
rm -rf "$place/run"
mkdir "$place/run"
cp -R src firmware "$place/run"
place=$(cd "$place" && pwd)
cd "$place/run"
PYTHONPATH="$(printf "$place/run/%s:" src/hindrax_*)$place/site"
# CI: hypothesis then knows no deadline of an example, which an emulated processor would miss.
export PYTHONPATH PYTHONHOME="$place/root/usr" PYTHONDONTWRITEBYTECODE=1 CI=true
[ $# -gt 0 ] || set -- src/hindrax_core/test src/hindrax_drivers/test src/hindrax_bag/test src/hindrax_ident/test/test_rls.py \
  src/hindrax_ident/test/test_models.py src/hindrax_ident/test/test_session.py src/hindrax_control/test/test_allocation.py
# What starts another Python cannot be run: without binfmt the kernel does not know that processor. And qemu knows no BREAK
# and no speed of a line above 115200.
for one in hindrax_core/test/test_sensor_table.py::test_an_installed_package_adds_a_row_and_a_broken_one_harms_no_other \
  hindrax_bag/test/test_completion.py::test_an_unfinished_bag_is_resumed_completed_and_indexed \
  hindrax_bag/test/test_completion.py::test_files_are_completed_beside_the_flight_or_nothing_is_started \
  hindrax_drivers/test/test_serial_port.py::test_an_auto_baud_device_is_woken_before_the_bytes \
  hindrax_drivers/test/test_serial_port.py::test_the_line_has_the_wanted_speed; do
  set -- "$@" --deselect "src/$one"
done
exec "${QEMU:-qemu-aarch64-static}" -L "$place/root" "$place/root/usr/bin/python3.11" -m pytest -q -p no:cacheprovider \
  -c /dev/null --rootdir . --import-mode=importlib "$@"
