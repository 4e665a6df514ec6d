#!/usr/bin/env bash
# The program with the page inside (page.sh makes it), and the page's tests in Chromium: in its
# headless shell, which does the same with half the work, or in the whole of it. The shell is
# installed where this costs nobody a password or where there is no Chromium at all.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}

have() { command -v "$1" >/dev/null; }

install() {
    local as_root=()
    ((EUID == 0)) || as_root=(sudo)
    "${as_root[@]}" apt-get -qq update &&
        "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
            apt-get -qq install -y --no-install-recommends "$1" >/dev/null
}

if [[ -z ${CHROMIUM:-} ]]; then
    if ! have chromium-headless-shell && { ((EUID == 0)) || ! have chromium; }; then
        install chromium-headless-shell || have chromium || install chromium
    fi
    CHROMIUM=$(command -v chromium-headless-shell || command -v chromium)
fi
export CHROMIUM

cargo build --locked --release --features page -p ballbot-cli
cd web
BALLBOT=$CARGO_TARGET_DIR/release/ballbot npm test
