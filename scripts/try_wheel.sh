#!/bin/sh
# Installs a wheel into an empty environment, without Rust, and runs the demo there; says how long it took.
#
# usage: scripts/try_wheel.sh PYTHON WHEEL
set -eu

python=$1 wheel=$2
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT

"$python" -m venv "$place/venv"
begun=$(date +%s)
"$place/venv/bin/python" -m pip install --quiet --disable-pip-version-check --only-binary :all: "$wheel"
# No compiler can be found from here.
(cd "$place" && PATH="$place/venv/bin" twinloop run quadrotor --experiments 4 --noise 0.001 --seed 0 --output demo.json >/dev/null)
"$place/venv/bin/python" - "$place/demo.json" <<'CHECK'
import json
import sys

found = json.load(open(sys.argv[1], encoding="utf-8"))
assert len(found["experiments"]) == 4 and not found["interrupted"], "expected four experiments"
CHECK
echo "$(basename "$wheel"): installed and flown in $(($(date +%s) - begun)) s"
