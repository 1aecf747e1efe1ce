#!/bin/sh
# Says in one sentence what this machine lacks to build Twinloop, and exits 1; says nothing when all is there.
# The versions asked for are read where they are stated: pyproject.toml and Cargo.toml.
#
# usage: scripts/preflight.sh [python]

root=$(dirname "$0")/..
python=${1:-python3}

fail() {
    echo "twinloop: $1" >&2
    exit 1
}

stated() { # stated KEY FILE: the version number in the first line `KEY = "..."`
    sed -n 's/^'"$1"'[[:space:]]*=[[:space:]]*"[^0-9]*\([0-9][0-9.]*\).*/\1/p' "$2" | head -n 1
}

at_least() { # at_least FOUND WANTED: compares major.minor
    found_major=${1%%.*} found_rest=${1#*.}
    wanted_major=${2%%.*} wanted_rest=${2#*.}
    [ "$found_major" -gt "$wanted_major" ] ||
        { [ "$found_major" -eq "$wanted_major" ] && [ "${found_rest%%.*}" -ge "${wanted_rest%%.*}" ]; }
}

python_wanted=$(stated requires-python "$root/pyproject.toml")
rust_wanted=$(stated rust-version "$root/Cargo.toml")
[ -n "$python_wanted" ] || fail "pyproject.toml states no requires-python; restore that line."
[ -n "$rust_wanted" ] || fail "Cargo.toml states no rust-version; restore that line."

python_found=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null) ||
    fail "Python $python_wanted or newer is needed, but \`$python\` does not run; install it, or name one with \`make PYTHON=...\`."
at_least "$python_found" "$python_wanted" ||
    fail "Python $python_wanted or newer is needed, but \`$python\` is $python_found; install a newer one, or name it with \`make PYTHON=...\`."
"$python" -c 'import ensurepip, venv' 2>/dev/null ||
    fail "\`$python\` cannot make virtual environments; install its venv module (on Debian and Ubuntu: python3-venv)."

cargo --version >/dev/null 2>&1 ||
    fail "Rust $rust_wanted or newer is needed, but \`cargo\` does not run; install Rust from https://rustup.rs."
rust_found=$(rustc --version 2>/dev/null | sed -n 's/^rustc \([0-9][0-9.]*\).*/\1/p')
[ -n "$rust_found" ] ||
    fail "Rust $rust_wanted or newer is needed, but \`rustc\` does not run; install Rust from https://rustup.rs."
at_least "$rust_found" "$rust_wanted" ||
    fail "Rust $rust_wanted or newer is needed, but \`rustc\` is $rust_found; run \`rustup update stable\`."

"${CC:-cc}" --version >/dev/null 2>&1 ||
    fail "A C compiler is needed to link, but \`${CC:-cc}\` does not run; install gcc or clang (on Debian and Ubuntu: build-essential)."
