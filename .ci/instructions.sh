#!/usr/bin/env bash
# Counts the instructions of controller steps on this machine (f64, release build) under valgrind, and fails when a count grows by more than 5 % over .ci/instructions.txt. The counts do
# not depend on load or clock, but on the compiler: with another one they are shown, not compared.
# `instructions.sh --write` takes the counts as the new ones.
set -euo pipefail
shopt -s inherit_errexit
cd "$(dirname "$0")/.."
file=.ci/instructions.txt
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}
# With the program named, its dependencies are those that are built already.
cargo build --locked --release -p ballbot-cli -p ballbot-scenario --example count_steps --example count_far_steps
cargo build --locked --release -p ballbot-cli -p lpvmpc-cli --bin lpvmpc
directory=$(mktemp -d)
trap 'rm -rf "$directory"' EXIT

# The counts of all steps of an example (its name, its arguments), one per line, in ascending order. Callgrind
# writes a file per call of the function `counted_step`. Without environment, whose size would move the stack.
counts() {
    local example=$1
    rm -f "$directory"/*
    if ! env -i PATH=/usr/bin:/bin valgrind --tool=callgrind --toggle-collect='*counted_step*' \
        --dump-after="$example::counted_step" --callgrind-out-file="$directory/out" \
        "$CARGO_TARGET_DIR/release/examples/$example" "${@:2}" >"$directory/log" 2>&1; then
        cat "$directory/log" >&2
        exit 1
    fi
    cat "$directory"/out.* | sed -n 's/^totals: //p' | sort -n
}

# The count of all steps of a closed loop of the program `lpvmpc`, whose plant and sizes are data: a descent 1 m aside.
any_plant() {
    local lpvmpc=$CARGO_TARGET_DIR/release/lpvmpc
    rm -rf "${directory:?}"/*
    "$lpvmpc" example plant >"$directory/plant.json"
    cat >"$directory/experiment.toml" <<'END'
name = "count"
plant = "plant.json"
x0 = [0, 0, 0, 0]
duration = 4
controller = { t_s = 0.04, horizon = 20, q = [10, 10, 0.1, 0.1], r = [0.01] }
reference = [{ time = 0, x = [1, 0, 0, 0] }]
END
    if ! env -i PATH=/usr/bin:/bin valgrind --tool=callgrind --toggle-collect=lpvmpc_any::mpc::Mpc::step \
        --callgrind-out-file="$directory/count" "$lpvmpc" simulate "$directory/experiment.toml" \
        --out "$directory/run" >"$directory/log" 2>&1; then
        cat "$directory/log" >&2
        exit 1
    fi
    sed -n 's/^totals: //p' "$directory/count"
}

measure() {
    # Without active bounds all steps but the first are alike: the last one is the most.
    counts count_steps lissajous 20 | awk 'END { print "no_active_bound", $1 }'
    counts count_steps tight-bounds 80 | awk 'END { print "tight_bounds_worst", $1 }'
    counts count_far_steps | awk '
        { count[NR] = $1 }
        END {
            print "guaranteed_far_median", count[int(NR / 2)]
            print "guaranteed_far_p99", count[int(NR * 0.99)]
        }'
    # At the edge of the bounds with no plan to be found: most programs have no answer, at horizons where to prove that takes longest.
    echo guaranteed_hopeless "$(counts count_far_steps 200 -0.8005 26.0737 -6.0890)"
    echo any_plant_100_steps "$(any_plant)"
}

compiler=$(rustc --version)
now=$(measure)
if [[ ${1:-} == --write ]]; then
    {
        echo "# Instructions of one controller step (f64, one plane, horizon 20), of 400 guaranteed ones to far set points"
        echo "# (median, 99 %), of a first one from where there is no plan (horizon 200), and of 100 of a cart-pole from a"
        echo "# file (descent, horizon 20), on x86-64, checked by instructions.sh; written by instructions.sh --write with"
        echo "# compiler: $compiler"
        echo "$now"
    } >"$file"
fi
last_compiler=$(sed -n 's/^# compiler: //p' "$file")
if [[ $compiler != "$last_compiler" ]]; then
    echo "instructions: NOT COMPARED: counted last time with $last_compiler, now with $compiler"
    echo "$now"
    exit 0
fi
awk '
    /^#/ { next }
    NR == FNR { last[$1] = $2; next }
    { now[$1] = $2 }
    !($1 in last) { print "instructions: no last count of " $1; failed = 1; next }
    {
        change = 100 * ($2 / last[$1] - 1)
        printf "instructions: %-21s %9d  last time %9d  %+.1f %%\n", $1, $2, last[$1], change
        if (change > 5) { print "instructions: FAILED, more than 5 % more"; failed = 1 }
        if (change < -5) print "instructions: less; take it over with .ci/instructions.sh --write"
    }
    END {
        # The slowest samples of a loop are what its time is planned for.
        if (now["guaranteed_far_p99"] > 1.5 * now["guaranteed_far_median"]) {
            print "instructions: FAILED, 99 % of the far guaranteed steps are not within 1.5 times the median"
            failed = 1
        }
        exit failed
    }
' "$file" - <<<"$now"
