# shellcheck shell=bash
# shellcheck disable=SC2154 # until_caught is that of ./hindrax: Ctrl-C waits for a short Python, and then ends the set-up
# shellcheck disable=SC2016 # single quotes hold text that another shell expands
#
# What ./hindrax knows about setting a machine up. Sourced with `root` set to the repository; only defines functions.
#
# Everything made here lies in .hindrax/ and ros_ws/{build,install,log}, and may be deleted at any time:
#
#   .hindrax/bootstrap/       a small environment that holds the installer (uv)
#   .hindrax/env/             the Python environment, with ROS 2 in it unless the machine has a ROS installation
#   .hindrax/environment.sh   the variables of the sourced workspace, so that no run has to source it again
#   .hindrax/cache/           what uv, ROS and matplotlib keep (logs, downloads, fonts)
#   .hindrax/vehicle          there where the set-up is that of a vehicle, without the tests
#   .hindrax/python, asked    the interpreter in use, and the HINDRAX_PYTHON that led to it
#   .hindrax/ready            fingerprint of all that the above was made from
#
# Each part carries a stamp that is removed before and written after work on it. Whatever ends a set-up at whatever
# moment, the next one finds a part without its stamp and makes that part anew.

# A ROS 2 Jazzy installation, or "wheels".
ros=${HINDRAX_ROS:-/opt/ros/jazzy}
[ -n "${HINDRAX_ROS-}" ] || [ -e "$ros/setup.bash" ] || ros=wheels
state=${root:?}/.hindrax
env=$state/env
workspace=$root/ros_ws
log=$state/setup.log

# shellcheck source=setup/needs.sh
. "$root/setup/needs.sh"

setup_help() {
  cat <<'END'
Usage: ./hindrax setup [--check | --vehicle | --all]

Makes everything that hindrax needs, inside this clone. Any other command does the same when something is missing
or has changed; this one is for doing it early, and for repair: it tests what is there and makes anew what does not
work.

  --check     only say what is there and what is missing; exit 1 if something is
  --vehicle   without what only tests, peers and benchmarks need; later set-ups of this clone do the same
  --all       with them again

ROS 2 Jazzy is taken from /opt/ros/jazzy when it is there, otherwise from pinned Python wheels (Linux x86-64).

  HINDRAX_PYTHON   interpreter to use, 3.11 or 3.12 (default: the first one found)
  HINDRAX_ROS      another ROS 2 Jazzy installation, or "wheels" to leave an existing one aside
  HINDRAX_CACHE    folder of compiled messages that several clones share (default: each keeps its own)

Example: HINDRAX_PYTHON=python3.12 ./hindrax setup
END
}

setup_command() {
  case ${1-} in
    '') set_up_or_repair ;;
    --check) check ;;
    --vehicle)
      { mkdir -p "$state" && : >"$state/vehicle"; } 2>/dev/null || fail "$(unwritable)"
      set_up_or_repair
      compile_modules
      ;;
    --all) rm -f "$state/vehicle"; set_up_or_repair ;;
    -h | --help) setup_help ;;
    *)
      echo "hindrax: setup takes --check, --vehicle, --all or --help, not $1" >&2
      exit 2
      ;;
  esac
}

# --- What needs no set-up ---------------------------------------------------------------------------------------------

answers_before_setup() { # WORD...
  local word commands=$root/src/hindrax_cli/hindrax_cli/command.py
  case ${1-} in '' | -h | --help | help | --version | completion) return ;; esac
  for word; do
    case $word in -h | --help) return ;; esac
  done
  # Neither must a word that is no command.
  [ -f "$commands" ] && ! grep -q "[ \"]$1[ \"]" "$commands"
}

# With any Python from 3.9 on, of which nothing is wanted but its library.
answer_before_setup() { # WORD...
  local candidate
  for candidate in "${HINDRAX_PYTHON-}" python3 python3.12 python3.11; do
    "$candidate" -I -c 'import sys; sys.exit(sys.version_info < (3, 9))' 2>/dev/null || continue
    "${until_caught[@]}" "$candidate" -I -B - "$root" "$@" <<'END'
import sys
from pathlib import Path

root = Path(sys.argv[1])
sys.path[:0] = [str(folder) for folder in root.glob("src/hindrax_*")]
from hindrax_cli.command_page import main

sys.exit(main(root, sys.argv[2:]))
END
    return
  done
  setup_help
  fail "found no Python, wanted 3.9 or newer for help and 3.11 or 3.12 to run"
}

say() { printf '[%3d s] %s\n' "$SECONDS" "$*" >&2; }

fail() {
  echo "hindrax: $*" >&2
  exit 1
}

# --- Is it made, and from what is here now? --------------------------------------------------------------------------

has_ros() { [ "$ros" != wheels ]; }

stamped() { [ -e "$1" ] && [ "$(<"$1")" = "$2" ]; }

# Contents where a build depends on them; names only of files that an installed link leads to.
build_inputs() (
  cd "$root"
  export LC_ALL=C
  find src setup/tf2_msgs -type f \( -name package.xml -o -name setup.cfg -o -name setup.py -o -name CMakeLists.txt \
    -o -name '*.msg' -o -name '*.srv' -o -name '*.action' \) -print0 | sort -z | xargs -0 sha256sum
  find src -name __pycache__ -prune -o -type f \( -path 'src/*/launch/*' -o -path 'src/*/vehicles/*' \
    -o -path 'src/*/resource/*' \) -print | sort
)

fingerprint() {
  {
    echo "$root $ros $([ ! -e "$state/vehicle" ] || echo vehicle)"
    build_inputs
    cat "$root"/setup/*.{cmake,lock,sh,py}
  } | sha256sum
}

is_ready() {
  [ -x "$env/bin/python" ] && [ -e "$state/environment.sh" ] && [ -d "$workspace/install/hindrax_msgs" ] \
    && { [ -z "${HINDRAX_PYTHON-}" ] || stamped "$state/asked" "$HINDRAX_PYTHON"; } \
    && stamped "$state/ready" "$(fingerprint)"
}

works() (
  # shellcheck source=/dev/null
  . "$state/environment.sh"
  "$env/bin/python" -c 'import matplotlib, mcap, numpy, rclpy, scipy, hindrax_core, hindrax_msgs.msg, tf2_msgs.msg' >>"$log" 2>&1
)

check() {
  needs
  apt_line
  if is_ready; then
    printf '  %-8s %-10s  %s\n' ok set-up "complete and up to date"
  else
    printf '  %-8s %-10s  %s\n' 'to do' set-up "./hindrax setup makes it, in about two minutes, with the network"
    exit 1
  fi
  [ ${#missing[@]} -eq 0 ]
}

# --- One step of the work --------------------------------------------------------------------------------------------

# Runs a command with its output in the log, and shows that it is alive.
attempt() { # SENTENCE COMMAND...
  local sentence=$1 failed=0 pulse begun
  shift
  say "$sentence"
  begun=$(wc -l 2>/dev/null <"$log" || echo 0)
  # The pulse holds neither the lock nor a pipe that a caller may wait for, and ends with the script.
  (while sleep 10 2>/dev/null && kill -0 $$ 2>/dev/null; do say "... still $sentence$(built_since "$begun")"; done) 9>&- <&- >/dev/null &
  pulse=$!
  "$@" >>"$log" 2>&1 </dev/null || failed=1
  kill $pulse
  wait $pulse 2>/dev/null || true
  return $failed
}

# How many packages colcon has built since a line of the log; nothing where it builds none.
built_since() { # LINES
  local built
  built=$(tail -n "+$(($1 + 1))" "$log" 2>/dev/null | grep -c '^Finished <<<') || return 0
  echo ": $built of $(find "$root/src" "$root/setup" -maxdepth 2 -name package.xml | wc -l) packages"
}

# The same for what must succeed: says why it did not, and ends.
step() { attempt "$@" || explain "$1"; }

explain() {
  local end
  end=$(tail -n 200 "$log")
  tail -n 20 <<<"$end" | sed 's/^/    /' >&2
  if grep -qi 'no space left' <<<"$end"; then
    fail "$1 failed: the disk is full ($(free_mb) MB free in $root). Make room and run again; what is done is kept."
  elif grep -qiE 'certificate_?verify_?failed|certificate verify failed|unknownissuer' <<<"$end"; then
    fail "$1 failed: the package index shows a certificate that is not trusted here. If your network puts its own in" \
      "between, name the file of its authority: pip config set global.cert FILE (or SSL_CERT_FILE), and run again."
  elif grep -qiE 'name resolution|dns error|error sending request|network is unreachable|timed? ?out' <<<"$end" \
    || grep -qiE 'connection (refused|reset|error)|could not connect|failed to fetch' <<<"$end"; then
    fail "$1 failed: the package index does not answer. Check network and proxy (pip's settings are used) and run" \
      "again; what is done is kept."
  fi
  fail "$1 failed; its last lines are above, all of them in $log"
}

# Moves a directory away before it deletes it: compilers that outlived an interrupted build may still write there.
discard() {
  [ -e "$1" ] || return 0
  mv "$1" "$(mktemp -d "$state/old.XXXXXX")"
  rm -rf "$state"/old.* 2>/dev/null || true
}

# --- The parts -------------------------------------------------------------------------------------------------------

# Zip archives, and git where core.symlinks is off, leave plain files where the links of this clone belong.
restore_links() {
  local link
  for link in ros_ws/src=../src firmware/hindrax_mcu=../src/hindrax_sim/hindrax_sim/firmware; do
    [ -d "$root/${link%=*}" ] && continue
    say "making ${link%=*} the link that it has to be"
    rm -f "$root/${link%=*}"
    ln -s "${link#*=}" "$root/${link%=*}" 2>>"$log" \
      || fail "$root/${link%=*} has to be a link to ${link#*=}, and none can be made there:" \
        "clone with git onto a disk that has symbolic links"
  done
}

make_bootstrap() {
  local identity
  identity="$python $(sha256sum <"$root/setup/bootstrap.lock")"
  stamped "$state/bootstrap/complete" "$identity" && return
  discard "$state/bootstrap"
  # pip asks rustc for its version; where that is rustup's, it would put its settings into the home.
  local -x RUSTUP_HOME=${RUSTUP_HOME:-$state/cache/rustup}
  step "making a place for the installer" "$python" -I -m venv "$state/bootstrap"
  step "fetching the installer" "$state/bootstrap/bin/python" -I -m pip install --disable-pip-version-check --no-input \
    --no-cache-dir \
    --require-hashes --only-binary :all: --requirement "$root/setup/bootstrap.lock"
  echo "$identity" >"$state/bootstrap/complete"
}

# uv does not read pip's settings, and where an index is mirrored they are the ones that people have made.
adopt_pip_settings() {
  local settings name
  settings=$("${until_caught[@]}" "$state/bootstrap/bin/python" -I -m pip config list)
  setting() { sed -n "s/^[^=]*\.$1='\(.*\)'\$/\1/p" <<<"$settings" | head -n 1; }
  export UV_DEFAULT_INDEX=${UV_DEFAULT_INDEX:-${UV_INDEX_URL:-$(setting index-url)}}
  export UV_INSECURE_HOST=${UV_INSECURE_HOST:-$(setting trusted-host)}
  export SSL_CERT_FILE=${SSL_CERT_FILE:-$(setting cert)}
  export ALL_PROXY=${ALL_PROXY:-$(setting proxy)}
  for name in UV_DEFAULT_INDEX UV_INSECURE_HOST SSL_CERT_FILE ALL_PROXY; do
    [ -n "${!name}" ] || unset "$name"
  done
}

# Always from nothing: the wheels of ROS carry older metadata beside their own, and what changes an environment in place
# takes that for packages that are no longer wanted.
make_environment() {
  local uv=$state/bootstrap/bin/uv lock=$root/setup/wheels.lock options=() identity
  ! has_ros || lock=$root/setup/native.lock options=(--system-site-packages)
  if [ -e "$state/vehicle" ]; then
    "${until_caught[@]}" "$python" -I "$root/setup/vehicle_lock.py" "$lock" >"$state/vehicle.lock"
    lock=$state/vehicle.lock
  fi
  identity="$root $ros $python $(sha256sum <"$lock")"
  stamped "$env/complete" "$identity" && return
  rm -f "$state/asked"
  discard "$env"
  # Linked into the environment from there, so that it takes no room beside it; a shared one is the user's to name.
  export UV_CACHE_DIR=${UV_CACHE_DIR:-$state/cache/uv}
  step "making the Python $version environment" "$uv" venv --no-project --python "$python" "${options[@]}" "$env"
  adopt_pip_settings
  # Two packages are published as source only; the lock also pins what builds them.
  step "installing $(grep -c '^[a-z]' "$lock") Python packages" "$uv" pip install --python "$env/bin/python" \
    --require-hashes --no-deps --only-binary :all: --no-binary empy --no-binary padasip \
    --build-constraints "$root/setup/wheels.lock" --requirement "$lock"
  has_ros || write_underlay
  echo "$identity" >"$env/complete"
  echo "$python" >"$state/python"
}

# Makes the environment a prefix as colcon knows them, so that sourcing the workspace brings ROS along.
write_underlay() {
  local libraries
  libraries=$env/lib$(printf ':%s' "$env"/lib/python*/site-packages/ros_*.libs)
  cat >"$env/local_setup.sh" <<END
# ROS 2 Jazzy from wheels, for any shell; made by ./hindrax.
export VIRTUAL_ENV="$env"
export PATH="$env/bin\${PATH:+:\$PATH}"
export AMENT_PREFIX_PATH="$env\${AMENT_PREFIX_PATH:+:\$AMENT_PREFIX_PATH}"
export CMAKE_PREFIX_PATH="$env\${CMAKE_PREFIX_PATH:+:\$CMAKE_PREFIX_PATH}"
export CMAKE_TOOLCHAIN_FILE="$root/setup/wheels.cmake"
export LD_LIBRARY_PATH="$libraries\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}"
export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3
# Without this every start of Python starts itself a second time to set LD_LIBRARY_PATH.
export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
END
  cp "$env/local_setup.sh" "$env/local_setup.bash"
}

# The shell of the build knows the ROS of this clone and nothing of another one that may be sourced.
source_ros() {
  unset AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH PYTHONHOME VIRTUAL_ENV
  set +eu
  # shellcheck source=/dev/null
  if has_ros; then . "$ros/setup.bash"; else . "$env/local_setup.bash"; fi
  set -eu
}

colcon_build() (
  source_ros
  cd "$workspace"
  # Without -j colcon passes -l, and ninja then starts one job at a time for fear of the load.
  MAKEFLAGS=-j$(nproc) && export MAKEFLAGS
  [ -z "$(command -v ninja)" ] || export CMAKE_GENERATOR=Ninja
  # The message of /tf is in no wheel; where the machine's ROS has it, that one is used.
  [ -e "$ros/share/tf2_msgs/package.xml" ] || set -- "$root/setup/tf2_msgs"
  ! has_kept_messages || set -- "$@" --packages-skip "${messages[@]}"
  colcon build --base-paths src "$@" || exit
  keep_messages || true
)

# --- Compiled messages ------------------------------------------------------------------------------------------------
#
# Two thirds of a build compile definitions that seldom change. What came of them is kept, by the hash of all that it is
# made from, in .hindrax/cache/messages or below the HINDRAX_CACHE of several clones. build/messages says what is
# installed: the hash, and whether it was built here or is a kept one. Text in it has @CLONE@ for the path of its clone;
# libraries hold the path only as a place to look in after LD_LIBRARY_PATH, which has them all.

messages=(hindrax_msgs tf2_msgs)

messages_key() (
  cd "$root"
  {
    echo "$version $(uname -m) $(getconf GNU_LIBC_VERSION 2>/dev/null)"
    cat setup/wheels.lock setup/*.cmake
    find src/hindrax_msgs setup/tf2_msgs -type f ! -name '*.md' -print0 | LC_ALL=C sort -z | xargs -0 sha256sum
  } | sha256sum | cut -c 1-32
)

messages_store() { echo "${HINDRAX_CACHE:-$state/cache}/messages"; }

# For a pattern of sed.
quoted() { printf '%s' "$1" | sed 's/[][\\.*^$|&]/\\&/g'; }

# Whether kept messages are installed, after an attempt to install them. Those of a machine's ROS are never kept.
has_kept_messages() {
  local key kept made=$workspace/build/messages
  ! has_ros && key=$(messages_key) || return 1
  if stamped "$made" "$key kept" && [ -d "$workspace/install/hindrax_msgs" ]; then return; fi
  if stamped "$made" "$key built"; then return 1; fi
  # Kept ones of other definitions: the builder would not overwrite them.
  [[ ! -e $made || $(<"$made") == *" built" ]] || discard_messages
  rm -f "$made"
  kept=$(messages_store)/$key.tar
  [ -e "$kept" ] || return 1
  echo "taking the compiled messages from $kept"
  discard_messages
  if mkdir -p "$workspace/install" "$workspace/build" && tar -C "$workspace/install" -xf "$kept" \
    && rewrite "$workspace/install" '@CLONE@' "$root"; then
    echo "$key kept" >"$made"
  else
    echo "they cannot be read; building them"
    discard_messages
    return 1
  fi
}

discard_messages() {
  local name
  rm -f "$workspace/build/messages"
  for name in "${messages[@]}"; do
    discard "$workspace/install/$name"
    discard "$workspace/build/$name"
  done
}

rewrite() { # FOLDER FROM TO
  local name
  for name in "${messages[@]}"; do
    [ -d "$1/$name" ] || continue
    { grep -rIlZF -- "$2" "$1/$name" || true; } | xargs -0 -r sed -i "s|$(quoted "$2")|$(quoted "$3")|g" || return
  done
}

keep_messages() {
  local key store copy name
  ! has_ros && key=$(messages_key) && store=$(messages_store) || return 0
  [ ! -e "$workspace/build/messages" ] || stamped "$workspace/build/messages" "$key built" || return 0
  echo "$key built" >"$workspace/build/messages"
  [ ! -e "$store/$key.tar" ] || return 0
  mkdir -p "$store" && copy=$(mktemp -d "$store/new.XXXXXX") || return
  for name in "${messages[@]}"; do
    [ ! -d "$workspace/install/$name" ] || cp -rL "$workspace/install/$name" "$copy/" || { rm -rf "$copy"; return 1; }
  done
  find "$copy" -name __pycache__ -prune -exec rm -r {} + && rewrite "$copy" "$root" '@CLONE@' \
    && tar -C "$copy" -cf "$copy.tar" . && mv "$copy.tar" "$store/$key.tar"
  rm -rf "$copy" "$copy.tar"
}

# --- The workspace ----------------------------------------------------------------------------------------------------

build_changes() { # IDENTITY
  [[ -e $workspace/build/complete && $(<"$workspace/build/complete") == "$1 "* ]] || return
  rm "$workspace/build/complete"
  attempt "building what changed" colcon_build
}

build_everything() {
  discard "$workspace/build"
  discard "$workspace/install"
  step "building the workspace" colcon_build
}

build_workspace() {
  local identity="$root $ros $python" inputs
  inputs=$({ cat "$env/complete" "$root"/setup/*.cmake && build_inputs; } | sha256sum)
  [ -d "$workspace/install" ] && stamped "$workspace/build/complete" "$identity $inputs" && return
  build_changes "$identity" || build_everything
  echo "$identity $inputs" >"$workspace/build/complete"
}

# Sourcing the workspace takes half a second, its outcome is a handful of variables.
write_environment() {
  local name value tools=$env/bin:$workspace/install/hindrax_cli/lib/hindrax_cli
  {
    echo "# The workspace as sourced, for any shell; made by ./hindrax."
    while IFS='=' read -r -d '' name value; do
      case $name in
        PATH) value=$tools:${value%:/usr/bin:/bin} ;;
        PYTHONPATH)
          ! has_ros || value=$value:$(echo "$env"/lib/python*/site-packages)
          value=$value:$root/tools
          ;;
        AMENT_* | CMAKE_* | COLCON_PREFIX_PATH | LD_LIBRARY_PATH | ROS_* | _ROS_* | VIRTUAL_ENV) ;;
        *) continue ;;
      esac
      case $name in
        PATH | PYTHONPATH | LD_LIBRARY_PATH)
          printf 'export %s=%q"${%s:+:$%s}"\n' "$name" "$value" "$name" "$name"
          ;;
        *) printf 'export %s=%q\n' "$name" "$value" ;;
      esac
    done < <(sourced_workspace)
    printf 'export HINDRAX_ROOT=%q\n' "$root"
    echo 'export RMW_IMPLEMENTATION="${RMW_IMPLEMENTATION:-rmw_fastrtps_cpp}"'
    # What a program keeps for itself goes below the clone too, where that can be written.
    printf 'if [ -w %q ]; then\n' "$state"
    printf '  export %s="${%s:-%s/cache/%s}"\n' ROS_HOME ROS_HOME "$state" ros MPLCONFIGDIR MPLCONFIGDIR "$state" matplotlib
    echo 'fi'
    echo 'export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"'
  } >"$state/environment.sh"
}

# `hindrax` in a shell that has the environment. The script of setuptools would look for its package in PYTHONPATH, and
# end in a traceback where the shell has set that to something else since.
write_launcher() {
  printf '#!/usr/bin/env bash\n# The tool as in the root of the clone; made by ./hindrax.\nexec %q "$@"\n' "$root/hindrax" \
    >"$env/bin/hindrax" && chmod +x "$env/bin/hindrax"
}

sourced_workspace() {
  local underlay=$ros/setup.bash
  has_ros || underlay=$env/local_setup.bash
  env -i HOME="${HOME-/}" PATH=/usr/bin:/bin bash -c '. "$1"; . "$2"; env -0' bash \
    "$underlay" "$workspace/install/local_setup.bash" 2>>"$log"
}

# --- The whole -------------------------------------------------------------------------------------------------------

set_up() {
  { mkdir -p "$state" && : >"$state/lock"; } 2>/dev/null || fail "$(unwritable)"
  exec 9>"$state/lock"
  flock -n 9 || { say "another set-up works here; waiting for it" && flock 9; }
  # The other one may have done all of it.
  is_ready || make_everything
  exec 9>&-
}

make_everything() {
  local want report
  want=$(fingerprint)
  report=$(needs && apt_line; [ ${#missing[@]} -eq 0 ]) || {
    echo "hindrax cannot be set up here yet:" >&2
    grep -v '^  ok ' <<<"$report" >&2
    exit 1
  }
  find_python
  rm -f "$state/ready"
  : >"$log"
  say "setting hindrax up, once; everything stays in"
  say "  $root"
  restore_links
  make_bootstrap
  make_environment
  build_workspace
  write_environment
  write_launcher
  say "trying it"
  works || {
    forget
    explain "trying it"
  }
  [ -z "${HINDRAX_PYTHON-}" ] || echo "$HINDRAX_PYTHON" >"$state/asked"
  echo "$want" >"$state/ready"
  say "ready"
}

# What does not work although it was made is not kept.
forget() { rm -f "$state/ready" "$env/complete" "$workspace/build/complete"; }

# The service of a vehicle may not write here: what is not compiled now, every one of its starts would compile again.
# Of the installed packages some hold templates that are no Python.
compile_modules() {
  "$env/bin/python" -m compileall -q -j 0 "$env/lib" "$workspace/install" "$root/src" >>"$log" 2>&1 || true
}

set_up_or_repair() {
  if is_ready && ! works; then
    say "what is there does not work; making it anew"
    forget
  fi
  set_up
  say "hindrax is set up"
}
