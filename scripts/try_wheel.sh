#!/bin/sh
# Installs a wheel into an empty environment, without Rust, and runs the demo there; says how long it took, and how large
# the native module is, which must not grow beyond 4 MB.
#
# usage: scripts/try_wheel.sh PYTHON WHEEL
set -eu

python=$1 wheel=$2
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT

# In two steps: `python -m venv` alone does not say why pip could not be put there. Tried again, for a busy machine may
# refuse a process or a file only once.
"$python" -m venv --without-pip "$place/venv"
with_pip() { "$place/venv/bin/python" -m ensurepip --default-pip >"$place/ensurepip" 2>&1; }
with_pip || with_pip || {
    cat "$place/ensurepip"
    df -h "$place"
    exit 1
} >&2
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
seconds=$(($(date +%s) - begun))
"$place/venv/bin/python" - <<'SIZE'
import sys
from pathlib import Path

import twinloop

most = 4_000_000
(module,) = Path(twinloop.__file__).parent.glob("_core*.so")
size = module.stat().st_size
print(f"{module.name}: {size} bytes of {most} at most")
if size > most:
    sys.exit("expected a smaller native module: `nm --size-sort -C` says what is compiled how often")
SIZE
# What is no Python has come along: templates, styles, sources of exports.
"$place/venv/bin/python" -m pip install --quiet --disable-pip-version-check --only-binary :all: "$wheel[report,dashboard]"
(
    cd "$place" && PATH="$place/venv/bin"
    twinloop run quadrotor --preset paper --generations 5 --experiments 2 --store demo.db >/dev/null 2>&1
    twinloop report demo.db -o demo.html 2>/dev/null
    python -c 'from pathlib import Path; import twinloop; root = Path(twinloop.__file__).parent; assert all(any(root.rglob(f"*.{e}")) for e in ("html", "css", "js", "c", "h")), "files are missing"'
)
test -s "$place/demo.html"
echo "$(basename "$wheel"): installed and flown in $seconds s"
