#!/usr/bin/env bash
# Proves by linking that a controller's step, with all it calls, has no path to a panic
# (firmware/no-panic/src/bin/panic_free.rs), and that the proof can fail: panic_reachable.rs must
# be refused by the linker for that reason. On failure it names the source lines that can panic.
set -euo pipefail
cd "$(dirname "$0")/../firmware"
target=thumbv7em-none-eabihf
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/../target}/cross
cross=../.ci/cross-cargo.sh
log=$(mktemp)
trap 'rm -f "$log"' EXIT

links() {
    "$cross" "$target" build --locked --release -p no-panic --bin "$1" >"$log" 2>&1
}

refused_for_a_panic_path() { grep -q 'undefined symbol: a_panic_path_is_reachable' "$log"; }

# Links all the same, keeps the relocations, and shows the source of every call that can panic.
show_panic_paths() {
    "$cross" "$target" rustc --locked --release -p no-panic --bin "$1" -- \
        -C link-arg=--unresolved-symbols=ignore-all -C link-arg=--emit-relocs \
        -C llvm-args=-enable-tail-merge=false 2>"$log"
    local image=$CARGO_TARGET_DIR/$target/release/$1
    readelf -rW "$image" |
        awk '/R_ARM_THM_(CALL|JUMP24)/ && /panicking|slice_index|len_mismatch|(unwrap|expect)_failed/ \
             { print "0x" $1 }' |
        addr2line --exe="$image" --inlines --functions --pretty-print --demangle=rust |
        grep -v '^core::'
}

if ! links panic_free; then
    refused_for_a_panic_path || { cat "$log"; exit 1; }
    echo "no-panic: FAILED, these calls can panic:"
    show_panic_paths panic_free
    exit 1
fi
echo "no-panic: panic_free links, so a step cannot panic"

if links panic_reachable || ! refused_for_a_panic_path; then
    cat "$log"
    echo "no-panic: FAILED, the negative control was not refused: the check proves nothing"
    exit 1
fi
echo "no-panic: panic_reachable is refused, so the check can fail"
