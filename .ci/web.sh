#!/usr/bin/env bash
# The browser page: WebAssembly module, page, program with the page inside, tests in Chromium.
# Installs what it needs: the WebAssembly target (install-targets.sh), Chromium, npm packages.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}

.ci/install-targets.sh
if [[ -z ${CHROMIUM:-} ]] && ! command -v chromium >/dev/null; then
    as_root=()
    ((EUID == 0)) || as_root=(sudo)
    "${as_root[@]}" apt-get -qq update
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get -qq install -y --no-install-recommends chromium >/dev/null
fi
export CHROMIUM=${CHROMIUM:-$(command -v chromium)}

cd web
npm ci --no-audit --no-fund
npm run build
node scripts/sizes.mjs --fail
cargo build --locked --release --features page -p ballbot-cli
BALLBOT=$CARGO_TARGET_DIR/release/ballbot npm test
