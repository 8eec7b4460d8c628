#!/bin/sh
# The extension: the stack of the vehicle in vehicle.yaml, and its page. When either ends, both do, and BlueOS starts them again.
# BlueOS forwards the MAVLink endpoint 127.0.0.1:14680 of the vehicle to port 14550 here.
set -eu
hindrax=${HINDRAX:-/opt/hindrax/hindrax}
stack='' page=''
stop() {
  # Not SIGINT: a shell lets what it starts in the background ignore it.
  for one in $page $stack; do kill -TERM "$one" 2>/dev/null || true; done
}
trap stop INT TERM

if [ ! -f "$HINDRAX_VEHICLE" ]; then
  echo "hindrax: no $HINDRAX_VEHICLE yet; asking the autopilot what vehicle it drives" >&2
  "$hindrax" vehicle new rov --from udpin:0.0.0.0:14550 --out "$HINDRAX_VEHICLE"
fi
"$hindrax" up --record &
stack=$!
# The page joins the graph of a stack that it finds; one that is not there yet it would look for elsewhere.
until "$hindrax" status --json 2>/dev/null | grep -q '"stack"'; do
  kill -0 "$stack" 2>/dev/null || break
  sleep 1
done
hosts=''
for one in $HINDRAX_HOSTS; do hosts="$hosts --host $one"; done
# shellcheck disable=SC2086 # a word for each option
"$hindrax" web --address 0.0.0.0 $hosts &
page=$!
while kill -0 "$stack" 2>/dev/null && kill -0 "$page" 2>/dev/null; do sleep 1; done
stop
code=0
wait "$stack" || code=$?
wait "$page" || code=$?
exit "$code"
