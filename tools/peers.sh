#!/usr/bin/env bash
# Makes build/peers, a virtual environment with OctoPrint, Printrun, marlin-host and mecode (tools/link_bench/peers.txt),
# anew only when that list has changed; installs Debian's pronsole where that is missing and may be.
# Says on stderr what is missing in the end; exit status 1 where the environment could not be made.
set -euo pipefail
cd "$(dirname "$0")/.."
list=tools/link_bench/peers.txt
stamp=build/peers/.made-of
sum="$(sha256sum "$list" | cut -d' ' -f1)"
python="${PYTHON:-python3}"

install() { # the packages of one half of the list: two at once take half the time
    grep -v '^#' "$list" | awk "NR % 2 == $1" > "build/peers/half-$1.txt"
    "$python" -m pip --python build/peers/bin/python install --quiet --quiet --disable-pip-version-check --no-input \
        --retries 1 --timeout 15 --no-deps --no-compile --only-binary :all: -r "build/peers/half-$1.txt"
}

debian_pronsole() {
    command -v pronsole > /dev/null && return
    if [ "$(id -u)" -ne 0 ] || ! command -v apt-get > /dev/null; then
        echo "pronsole is missing and cannot be installed here (Debian's package pronsole)" >&2
        return
    fi
    export DEBIAN_FRONTEND=noninteractive
    if ! timeout 120 apt-get install -qq -y --no-install-recommends pronsole > build/peers-apt.log 2>&1; then
        timeout 60 apt-get update -qq >> build/peers-apt.log 2>&1 || true
        timeout 120 apt-get install -qq -y --no-install-recommends pronsole >> build/peers-apt.log 2>&1 \
            || echo "pronsole could not be installed: $(tail -n 1 build/peers-apt.log)" >&2
    fi
}

mkdir -p build
debian_pronsole &
debian=$!
if [ "$(cat "$stamp" 2> /dev/null || true)" != "$sum" ]; then
    rm -rf build/peers
    "$python" -m venv --without-pip build/peers
    install 0 &
    half=$!
    install 1
    wait "$half"
    echo "$sum" > "$stamp"
fi
wait "$debian"
