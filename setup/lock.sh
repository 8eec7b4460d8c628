#!/bin/sh
# Resolves the *.in files to *.lock files, with a hash for every file that may be installed. Needs uv. Versions that are
# locked stay as they are; `setup/lock.sh --upgrade` takes up newer ones, `--upgrade-package NAME` those of one package.
# Then `./hindrax test` on Python 3.11 and 3.12, and commit both .in and .lock.
set -eu
cd "$(dirname "$0")"
upgrade=$*

lock() { # OUTPUT OPTION... INPUT...
  output=$1
  shift
  # shellcheck disable=SC2086 # words, not one
  uv pip compile --quiet $upgrade --no-header --generate-hashes --output-file "$output" \
    --only-binary :all: --no-binary empy --no-binary padasip "$@"
}

# Resolved for 3.11, the older of the two: whatever it admits, 3.12 admits as well. The wheels of ROS are x86-64 only.
lock bootstrap.lock --python-version 3.11 --universal bootstrap.in
lock wheels.lock --python-version 3.11 --python-platform x86_64-manylinux_2_28 ros.in runtime.in development.in
lock site.lock --python-version 3.11 --universal site.in

# A ROS installation brings ROS, colcon and numpy; the C extensions of ROS are built for that numpy (Ubuntu 24.04 has
# 1.26.4), so ours must not hide it, and everything else has to be of a version that runs with it.
echo 'numpy==1.26.4' | lock native.lock --python-version 3.12 --universal --no-emit-package numpy --constraint - \
  runtime.in development.in
