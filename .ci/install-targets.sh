#!/usr/bin/env bash
# Makes the machine able to build for the targets below and to run the firmware:
# - a target that rustup has is built by plain cargo and needs nothing more;
# - otherwise Debian's rustc-web, cargo-web and rust-web-src build its standard library from source;
# - qemu-system-arm runs the firmware image, valgrind counts instructions on the host.
# May be run again at any time: what is there already is not installed again.
set -euo pipefail

targets=(thumbv7em-none-eabihf wasm32-unknown-unknown)
installed=$(rustup target list --installed 2>/dev/null || true)
packages=()

for target in "${targets[@]}"; do
    if ! grep -qx "$target" <<<"$installed"; then
        packages+=(rustc-web cargo-web rust-web-src)
        break
    fi
done
packages+=(qemu-system-arm valgrind)

missing=()
for package in "${packages[@]}"; do
    status=$(dpkg-query -W -f='${Status}' "$package" 2>/dev/null || true)
    [[ $status == "install ok installed" ]] || missing+=("$package")
done

if ((${#missing[@]} == 0)); then
    echo "install-targets: nothing to install"
    exit 0
fi

echo "install-targets: installing ${missing[*]}"
as_root=()
((EUID == 0)) || as_root=(sudo)
"${as_root[@]}" apt-get -qq update
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get -qq install -y --no-install-recommends "${missing[@]}" >/dev/null
