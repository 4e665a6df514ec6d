#!/usr/bin/env bash
# Makes the machine able to run the page's tests: in Chromium's headless shell, which does the same with half the
# work, or in the whole of it. The shell is installed where this costs nobody a password or where there is no
# Chromium at all. CHROMIUM names another one. May be run again at any time.
set -euo pipefail

have() { command -v "$1" >/dev/null; }

install() {
    local as_root=()
    ((EUID == 0)) || as_root=(sudo)
    "${as_root[@]}" apt-get -qq update &&
        "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
            apt-get -qq install -y --no-install-recommends "$1" >/dev/null
}

if [[ -z ${CHROMIUM:-} ]] && ! have chromium-headless-shell && { ((EUID == 0)) || ! have chromium; }; then
    install chromium-headless-shell || have chromium || install chromium
fi
