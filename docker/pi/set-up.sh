#!/usr/bin/env bash
# Configures a Raspberry Pi 4 as the vehicle's computer: boot settings, device names, groups, time, service. It is
# idempotent: correct settings stay unchanged.
set -euo pipefail

here=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")
clone=${here%/docker/pi}
root='' dry='' kind=native tether='' user=hindrax

usage() {
  cat <<'END'
Usage: sudo docker/pi/set-up.sh [--dry-run] [--container] [--tether IFACE:TOPSIDE] [--root DIR]

  --dry-run    print what would be done, and do nothing
  --container  the stack runs in the container of docker/compose.yaml, not as a service of a ROS installation
  --tether     interface to the topside computer, and its address: eth0:192.168.2.1
  --root DIR   write the files below DIR and run no command: to see them, and for tests

Example: sudo docker/pi/set-up.sh --tether eth0:192.168.2.1
END
}

fail() {
  echo "set-up.sh: $*" >&2
  exit 2
}

while [ $# -gt 0 ]; do
  case $1 in
    --dry-run) dry=1 ;;
    --container) kind=container ;;
    --tether | --root)
      [ -n "${2-}" ] || fail "$1: found nothing after it, wanted a value; see --help"
      if [ "$1" = --root ]; then root=$2; else tether=$2; fi
      shift
      ;;
    -h | --help) usage && exit ;;
    *) fail "found $1, wanted one of the options of --help" ;;
  esac
  shift
done
byte='(25[0-5]|2[0-4][0-9]|1?[0-9]?[0-9])'
[[ -z $tether || $tether =~ ^[A-Za-z0-9._-]{1,15}:$byte(\.$byte){3}$ ]] \
  || fail "--tether: found '$tether', wanted interface and address of the topside computer: eth0:192.168.2.1"
[ -n "$root$dry" ] || [ "$(id -u)" = 0 ] || fail "changes the system: run it with sudo, or look with --dry-run"

changed=0 reboot=0

# Writes stdin to a file if it differs, and reports it.
keep() { # FILE
  local file=$root$1 text
  text=$(cat && echo .) && text=${text%.}
  if [ -e "$file" ] && [ "$(cat "$file" && echo .)" = "$text." ]; then
    echo "ok       $1"
    return 1
  fi
  echo "${dry:+would }write $1"
  changed=1
  [ -n "$dry" ] || { mkdir -p "$(dirname "$file")" && printf %s "$text" >"$file"; }
}

act() { # COMMAND...
  if [ -n "$root$dry" ]; then
    echo "would run $*"
  else
    echo "run $*"
    "$@"
  fi
}

# --- Boot: speed of I2C, a core clock that does not change, the UARTs -------------------------------------------------

boot=/boot/firmware/config.txt
[ -e "$root$boot" ] || [ ! -e "$root/boot/config.txt" ] || boot=/boot/config.txt
if [ -e "$root$boot" ]; then
  { sed '/^# hindrax begin$/,/^# hindrax end$/d' "$root$boot" && cat "$here/config.txt"; } | keep "$boot" && reboot=1
else
  echo "no       $boot: this is no Raspberry Pi; the speed of its I2C is for you to set"
fi
keep /etc/modules-load.d/hindrax.conf <<<'i2c-dev' || true

# --- Names, groups, time ----------------------------------------------------------------------------------------------

new_group=
for group in i2c gpio; do
  getent group "$group" >/dev/null || { act groupadd --system "$group" && new_group=1; }
done
# After the groups: udev looks them up as it reads the rules, and ignores what it does not find.
if keep /etc/udev/rules.d/60-hindrax.rules <"$here/60-hindrax.rules" || [ -n "$new_group" ]; then
  act udevadm control --reload
  act udevadm trigger --subsystem-match=tty --subsystem-match=i2c-dev --subsystem-match=gpio
fi
id "$user" >/dev/null 2>&1 || act useradd --system --user-group --home-dir /var/lib/hindrax --groups dialout,i2c,gpio "$user"
# A user who runs the doctor or a pool test needs access to the devices too.
for name in "$user" "${SUDO_USER-}"; do
  if [ -n "$name" ] && groups=$(id -nG "$name" 2>/dev/null) \
    && [[ " $groups " != *' i2c '* || " $groups " != *' gpio '* ]]; then
    act usermod --append --groups dialout,i2c,gpio "$name"
  fi
done
if [ -n "$tether" ]; then
  sed "s/TOPSIDE/${tether#*:}/" "$here/chrony-vehicle.conf" | keep /etc/chrony/conf.d/hindrax.conf \
    && act systemctl try-restart chrony
fi

# --- The stack --------------------------------------------------------------------------------------------------------

settings=/etc/hindrax/hindrax.env
words=$(cat "$root$settings" 2>/dev/null || cat "$here/hindrax.env")
if [ -n "$tether" ]; then words=$(sed "s/^HINDRAX_TETHER=.*/HINDRAX_TETHER=$tether/" - <<<"$words"); fi
keep "$settings" <<<"$words" || true
if [ "$kind" = container ]; then
  # The kernel gives the number of gpiochip; on a Pi it is 254.
  {
    echo "I2C_GID=$(getent group i2c | cut -d: -f3 | grep . || echo 998)"
    echo "GPIO_GID=$(getent group gpio | cut -d: -f3 | grep . || echo 997)"
    echo "GPIO_MAJOR=$(awk '$2 == "gpiochip" { print $1 }' /proc/devices | grep . || echo 254)"
  } | keep "${clone:?}/docker/.env" || true
else
  sed "s|/opt/hindrax|$clone|" "$here/hindrax.service" | keep /etc/systemd/system/hindrax.service || true
  if [ -n "$tether" ]; then
    # A second barrier beside the middleware profile: packets of other interfaces do not reach the stack at all.
    printf '[Service]\nRestrictNetworkInterfaces=lo %s\n' "${tether%%:*}" \
      | keep /etc/systemd/system/hindrax.service.d/tether.conf || true
  fi
  [ $changed = 0 ] || act systemctl daemon-reload
  act systemctl enable hindrax
fi

[ $reboot = 0 ] || echo "The boot settings have changed: sudo reboot"
