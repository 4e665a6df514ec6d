#!/usr/bin/env bash
# The program with the page inside (page.sh makes it), the time of the module's steps beside the program's, and the
# page's tests in Chromium (install-browser.sh).
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}

.ci/install-browser.sh
[[ -n ${CHROMIUM:-} ]] || CHROMIUM=$(command -v chromium-headless-shell || command -v chromium)
export CHROMIUM

cargo build --locked --release --features page -p ballbot-cli
cd web
export BALLBOT=$CARGO_TARGET_DIR/release/ballbot
node scripts/times.mjs --fail
npm test
