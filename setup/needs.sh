# shellcheck shell=bash
# shellcheck disable=SC2154 # root, ros, state and env are machine.sh's
#
# What a set-up needs from the machine, and how to get what is missing. Sourced by machine.sh; only defines functions.

# Prints version, headers, ensurepip, executable. It has to run: a pyenv shim exists even where its Python does not.
probe_python() {
  "$1" -I - 2>/dev/null <<'END'
import importlib.util, os, sys, sysconfig
headers = os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h"))
ensurepip = importlib.util.find_spec("ensurepip") is not None
print("%d.%d" % sys.version_info[:2], str(headers).lower(), str(ensurepip).lower(), sys._base_executable)
END
}

candidate_pythons() {
  if [ -n "${HINDRAX_PYTHON-}" ]; then
    echo "$HINDRAX_PYTHON"
  elif has_ros; then
    echo /usr/bin/python3
  else
    # An interpreter once chosen stays chosen: a run without HINDRAX_PYTHON does not undo one with it.
    cat "$state/python" 2>/dev/null || true
    printf '%s\n' python3 python3.12 python3.11 "${PYENV_ROOT:-${HOME-}/.pyenv}"/versions/3.1[12].*/bin/python3
  fi
}

# Sets python, version, headers and ensurepip to those of the first interpreter that will do; else python to what is.
find_python() {
  local candidate found=()
  while IFS= read -r candidate; do
    read -r version headers ensurepip python < <(probe_python "$candidate") || continue
    [[ $version =~ ^3\.1[12]$ ]] && return
    found+=("$python is $version")
  done < <(candidate_pythons)
  python=${found[*]:-no Python runs}
  return 1
}

compiles() (
  probe=$(mktemp -d) && trap 'rm -rf "$probe"' EXIT && cd "$probe" || exit
  echo '#include <string>' >probe.cpp
  echo '#include <stdio.h>' >probe.c
  "${CXX:-c++}" -c probe.cpp && "${CC:-cc}" -c probe.c
) >/dev/null 2>&1

free_mb() { df -Pm "$root" | awk 'NR == 2 {print $4}'; }

unwritable() { echo "$(id -un) may not write to $root: clone elsewhere, or sudo chown -R $(id -un) $root"; }

plain() { [[ ! $1 =~ [[:space:]:\"\'\$] ]]; }

holds() { if "$@" >/dev/null; then echo true; else echo false; fi; }

# One line on stdout for each need. What is not met goes to `missing`, the apt package that brings it to `packages`.
need() { # NAME MET SENTENCE_IF_MET SENTENCE_IF_NOT [PACKAGE]
  if $2; then
    printf '  %-8s %-10s  %s\n' ok "$1" "$3"
  else
    printf '  %-8s %-10s  %s\n' MISSING "$1" "$4"
    missing+=("$1")
    packages+=(${5:+"$5"})
  fi
}

needs() {
  missing=() packages=()
  need_ros
  need_python
  need compiler "$(holds compiles)" "${CXX:-c++} and ${CC:-cc} compile" \
    "${CXX:-c++} and ${CC:-cc} do not compile a file with a standard header; the message packages are C++ and C" g++
  local wanted=2000 free
  [ ! -e "$env/complete" ] || wanted=200
  free=$(free_mb)
  need disk "$(holds [ "$free" -ge $wanted ])" "$free MB free" \
    "$free MB free where $root lies, $wanted MB are wanted: make room or clone elsewhere"
  need place "$(holds plain "$root")" "$root" \
    "'$root' holds a space, quote, colon or dollar sign, which colcon's scripts do not bear: move the clone"
  need permission "$(holds [ -w "$root" ])" "$root is writable" \
    "$(unwritable)"
}

need_ros() {
  if has_ros; then
    need ROS "$(holds [ -e "$ros/setup.bash" ])" "$ros" "$ros holds no setup.bash; HINDRAX_ROS names another place"
    need colcon "$(holds command -v colcon)" "colcon is there" "colcon builds the packages and was not found" \
      python3-colcon-common-extensions
  else
    need machine "$(holds [ "$(uname -sm)" = 'Linux x86_64' ])" "$(uname -sm)" \
      "$(uname -sm) has no wheels of ROS, Linux x86_64 has: use ROS 2 Jazzy on Ubuntu 24.04, or the image in docker/"
  fi
}

need_python() {
  if find_python; then
    need Python true "$version, $python"
    need headers "$headers" "Python.h is there" \
      "$python has no Python.h, which the message packages compile against" "python$version-dev"
    need venv "$ensurepip" "ensurepip is there" \
      "$python has no ensurepip, which a new environment starts from" "python$version-venv"
  else
    need Python false '' "3.11 or 3.12 is wanted; $python. Install one, then name it:
                      HINDRAX_PYTHON=/path/to/python3.12 ./hindrax setup"
  fi
}

apt_line() { [ ${#packages[@]} -eq 0 ] || echo "To get what is missing:  sudo apt install ${packages[*]}"; }
