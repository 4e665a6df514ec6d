#!/usr/bin/env bash
# Builds the firmware, runs it on two emulated boards (Cortex-M4F and M7), compares its torques
# with the same controllers in f64 on this machine, and its cost with firmware/limits.toml.
# Instructions, not cycles: the emulator has no pipeline and no flash wait states.
set -euo pipefail
cd "$(dirname "$0")/.."
target=thumbv7em-none-eabihf
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}
images=$CARGO_TARGET_DIR/cross/$target/release
cross=$PWD/.ci/cross-cargo.sh

(
    cd firmware
    cargo fmt --check -p firmware -p no-panic
    CARGO_TARGET_DIR=$CARGO_TARGET_DIR/cross "$cross" "$target" build --locked --release \
        -p firmware --bins --examples
)
# With the program named, its dependencies are those that are built already.
cargo build --locked --release -p ballbot-cli -p ballbot-scenario \
    --example firmware_check --example firmware_record

# The recordings have the form that is written today; their numbers are those of the day that they were written on.
record() { "$CARGO_TARGET_DIR/release/examples/firmware_record" "$@"; }
form() { sed -E 's/-?[0-9][0-9.]*(e-?[0-9]+)?/N/g'; }
while read -r scenario samples recorded; do
    diff <(record "$scenario" "$samples" | form) <(form <"firmware/src/recorded/$recorded.rs")
done <<'END'
lissajous 40 lissajous
tight-bounds 80 tight_bounds
docs/examples/whole-robot.toml 40 whole_robot
END
# The wheels are the robot's own, and its parameters may be in a file of their own, beside the scenario.
robot=$(mktemp -d)
trap 'rm -rf "$robot"' EXIT
own='/^\[/ { own = ($0 == "[parameters]") } own == wanted'
awk -v wanted=1 "$own" docs/examples/whole-robot.toml >"$robot/robot.toml"
printf 'wheel_azimuths_deg = [0.0, 120.0, 240.0]\nwheels_reversed = [false, true, false]\n' >>"$robot/robot.toml"
{ echo 'parameters = "robot.toml"' && awk -v wanted=0 "$own" docs/examples/whole-robot.toml; } >"$robot/own-wheels.toml"
record "$robot/own-wheels.toml" 2 >"$robot/recorded.rs"
for wheel in "0.0, reversed: false" "2.0943952, reversed: true" "-2.0943952, reversed: false"; do
    grep -qF "azimuth: $wheel" "$robot/recorded.rs"
done
# What the firmware's controllers do not have is refused.
if refused=$(record one-metre 5 2>&1) || [[ $refused != *"the firmware does not have"* ]]; then
    echo "firmware_record one-metre: $refused" >&2
    exit 1
fi

# Flash: code, constants and initial data. The host's `size` counts sections by their flags,
# whatever the processor.
flash() { size --format=berkeley "$images/examples/$1" | awk 'NR == 2 { print $1 + $2 }'; }
compiler=$("$cross" "$target" --version)
output=$(mktemp)
trap 'rm -rf "$output" "$robot"' EXIT
for board in mps2-an386 mps2-an500; do
    printf '\n%s\n' "$board"
    if ! BOARD=$board firmware/run-qemu.sh "$images/measure" >"$output"; then
        tail -3 "$output"
        exit 1
    fi
    "$CARGO_TARGET_DIR/release/examples/firmware_check" \
        firmware/limits.toml "$compiler" \
        "$(flash bare_controllers)" "$(flash timer)" "$output"
done

# The program around a plant from a file, printed and built as it is, brings the plant to rest.
printf '\na printed plant\n'
folder=$(mktemp -d)
trap 'rm -rf "$output" "$robot" "$folder"' EXIT
cargo run --locked -p lpvmpc-plant --example firmware "$folder/plant"
# The same versions of the same dependencies.
cp firmware/Cargo.lock "$folder/plant"
(
    cd "$folder/plant"
    CARGO_TARGET_DIR=$CARGO_TARGET_DIR/cross "$cross" "$target" build --offline --release
)
firmware/run-qemu.sh "$images/plant-controller" >"$output"
# An instruction takes 8/5 of a tick. As above, 5 % more instructions than these are too many.
before=609681
awk -v before="$before" '
    { gsub(/[][,]/, " "); solved += $2; count = $NF * 5 / 8; if (count > worst) worst = count }
    END {
        for (i = 4; i < 8; i++) if ($i < -1e-3 || $i > 1e-3) far = 1
        printf "%d of %d samples solved, the last state: %s %s %s %s\n", solved, NR, $4, $5, $6, $7
        printf "instructions of a step, worst: %d (before: %d)\n", worst, before
        exit far || solved != NR || NR != 100 || worst > 1.05 * before || worst < 1000
    }
' "$output"
