#!/usr/bin/env bash
# The browser page: WebAssembly module and page (web/dist), within their sizes.
# Installs what it needs: the WebAssembly target (install-targets.sh), npm packages.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}

.ci/install-targets.sh
cd web
npm ci --no-audit --no-fund
npm run build
node scripts/sizes.mjs --fail
