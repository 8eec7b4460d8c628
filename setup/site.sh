#!/usr/bin/env bash
# Usage: setup/site.sh   Makes the environment that builds the site, from site.lock, and prints its folder.
# shellcheck disable=SC2034,SC2154 # what setup/machine.sh takes and gives
set -euo pipefail
root=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
# shellcheck source=setup/machine.sh
. "$root/setup/machine.sh"
until_caught=()
made=$state/site
identity=$(cat "$state/python" "$root/setup/site.lock" | sha256sum)
if ! stamped "$made/complete" "$identity"; then
  discard "$made"
  export UV_CACHE_DIR=${UV_CACHE_DIR:-$state/cache/uv}
  python=$(<"$state/python")
  step "making the environment of the site" "$state/bootstrap/bin/uv" venv --no-project --python "$python" "$made"
  adopt_pip_settings
  step "installing what builds the site" "$state/bootstrap/bin/uv" pip install --python "$made/bin/python" \
    --require-hashes --no-deps --only-binary :all: --requirement "$root/setup/site.lock"
  echo "$identity" >"$made/complete"
fi
echo "$made"
