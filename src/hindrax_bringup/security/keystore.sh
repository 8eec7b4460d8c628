#!/usr/bin/env bash
# Makes the keystore of a vehicle: keys and signed permissions for every process. Needs a ROS installation with sros2.
set -euo pipefail

here=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")

usage() {
  cat <<'END'
Usage: security/keystore.sh FOLDER [VEHICLE]

Makes a keystore with an enclave for every process, or signs the permissions of an existing one anew. Then set
HINDRAX_KEYSTORE=FOLDER on the vehicle. The topside computer gets only what FOLDER-topside holds: the operator's enclave
and the public part. FOLDER/private signs everybody's permissions: keep it on neither machine.

VEHICLE is the vehicle file, where its sensors have names that are not those of their kinds.

Example: security/keystore.sh ~/hindrax-keystore
END
}

case ${1-} in
  '' | -*) usage && exit 2 ;;
esac
folder=${1%/}
policies=$here/policies.xml
if [ $# -gt 1 ]; then
  policies=$(mktemp --suffix .xml)
  trap 'rm -f "$policies"' EXIT
  python3 -m hindrax_bringup.network.security "$2" >"$policies"
fi
command -v ros2 >/dev/null || {
  echo "keystore.sh: found no ros2; source /opt/ros/jazzy/setup.bash, and sudo apt install ros-jazzy-sros2" >&2
  exit 1
}

# One that was begun and not finished is completed: the governance is signed last.
[ -e "$folder/enclaves/governance.p7s" ] || ros2 security create_keystore "$folder"
while IFS= read -r enclave; do
  [ -e "$folder/enclaves$enclave/key.pem" ] || ros2 security create_enclave "$folder" "$enclave"
  ros2 security create_permission "$folder" "$enclave" "$policies"
done < <(sed -n 's/.*<enclave path="\([^"]*\)".*/\1/p' "$policies")

topside=$folder-topside
mkdir -p "$topside/enclaves/hindrax"
cp -RL "$folder/public" "$topside/"
cp "$folder"/enclaves/governance.* "$topside/enclaves/"
cp -RL "$folder/enclaves/hindrax/operator" "$topside/enclaves/hindrax/"
chmod -R go= "$folder" "$topside"
echo "the vehicle's: $folder    the topside computer's: $topside    take $folder/private away from both"
