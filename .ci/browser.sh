#!/usr/bin/env bash
# The program with the page inside (page.sh makes it), and the page's tests in Chromium, which is
# installed if it is not there.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}

if [[ -z ${CHROMIUM:-} ]] && ! command -v chromium >/dev/null; then
    as_root=()
    ((EUID == 0)) || as_root=(sudo)
    "${as_root[@]}" apt-get -qq update
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get -qq install -y --no-install-recommends chromium >/dev/null
fi
export CHROMIUM=${CHROMIUM:-$(command -v chromium)}

cargo build --locked --release --features page -p ballbot-cli
cd web
BALLBOT=$CARGO_TARGET_DIR/release/ballbot npm test
