#!/usr/bin/env bash
# cross-cargo.sh TARGET SUBCOMMAND [cargo arguments...]
#
# Runs `cargo SUBCOMMAND --target TARGET ...` with a toolchain that has the target's standard
# library: rustup's when `rustup target list --installed` names TARGET, else Debian's rustc-web
# with -Zbuild-std (see install-targets.sh). `cross-cargo.sh TARGET --version` tells which.
set -euo pipefail

if (($# < 2)); then
    echo "usage: $0 TARGET SUBCOMMAND [cargo arguments...]" >&2
    exit 2
fi
target=$1
subcommand=$2
shift 2

if rustup target list --installed 2>/dev/null | grep -qx "$target"; then
    [[ $subcommand == --version ]] && exec rustc --version
    exec cargo "$subcommand" --target "$target" "$@"
fi

if [[ ! -x /usr/bin/rustc || ! -x /usr/bin/cargo || ! -e /usr/lib/rustlib/src/rust/library ]]; then
    echo "$0: no toolchain for $target: run 'rustup target add $target', or install-targets.sh" >&2
    exit 1
fi

case $target in
*-none-*) build_std=core ;;
*) build_std=std,panic_abort ;;
esac
# Debian's compiler comes without rust-lld; rustup's has one for the host.
host=$(rustc -vV | sed -n 's/^host: //p')
PATH=$(rustc --print sysroot)/lib/rustlib/$host/bin:$PATH
# -Zbuild-std is unstable; RUSTC_BOOTSTRAP lets the stable compiler do it.
export PATH RUSTC=/usr/bin/rustc RUSTDOC=/usr/bin/rustdoc RUSTC_BOOTSTRAP=1
unset RUSTC_WRAPPER RUSTUP_TOOLCHAIN
[[ $subcommand == --version ]] && exec "$RUSTC" --version
exec /usr/bin/cargo "$subcommand" -Zbuild-std="$build_std" --target "$target" "$@"
