#!/usr/bin/env bash
# Everything again: our library, the problem files, the races, the tables and the figures.
#
#   run.sh SCRATCH [HPIPM_SOURCES]
#
# SCRATCH is a folder for the problem files (about 1 GB), builds and measurements. HPIPM_SOURCES holds `blasfeo`
# and `hpipm`; without it HPIPM is left out. Takes about 25 minutes once the files are there.
set -euo pipefail
mkdir -p "$1"
scratch=$(realpath "$1")
sources=${2:+$(realpath "$2")}
cd "$(dirname "$0")"
started=$SECONDS
step() { printf '\n== %s (%s s)\n' "$1" "$((SECONDS - started))"; }

step "our library"
build() { # folder, packages
    (cd .. && CARGO_TARGET_DIR="$scratch/$1" cargo build --locked --release "${@:2}")
}
build target -p lpvmpc-capi -p lpvmpc-problems
RUSTFLAGS="-C target-cpu=native" build target-native -p lpvmpc-capi
library=$scratch/target/release/liblpvmpc_c.so
native=$scratch/target-native/release/liblpvmpc_c.so

step "problem files"
write=$scratch/target/release/write-problems
problems=$scratch/problems
# The longest horizons with most bounds active take longest and come last.
if ! { timeout "${WRITE_SECONDS:-600}" "$write" "$problems" horizon=20 &&
    timeout "${WRITE_SECONDS:-600}" "$write" "$problems" horizon=50,100,200 share=0,0.4,0.8; } \
    > "$scratch/problems.log"; then
    echo "not all problem files are written; those that are not there are left out"
fi
files() { # size
    (cd "$problems" && ls "$1"-N20-*.qps "$1"-N{50,100,200}-*-{0,0.4,0.8}.qps 2> /dev/null || true)
}

results=$scratch/results
rm -rf "$results"
mkdir "$results"
note="$(grep -m1 'model name' /proc/cpuinfo | cut -d: -f2 | xargs), $(rustc --version | cut -d' ' -f1,2), \
lpvmpc $(git rev-parse --short HEAD), $(date +%F). lpvmpc: baseline x86-64; \
lpvmpc native: -C target-cpu=native."

if [[ -n $sources ]]; then
    step "HPIPM"
    hpipm/build.sh "$sources" "$scratch/hpipm"
    for size in 4x1 8x2 12x4 16x6; do
        # The faster of the two for each size: 512-bit vectors pay for the largest only.
        driver=$scratch/hpipm/driver-haswell
        [[ $size = 16x6 && -e $scratch/hpipm/driver-skylake-x ]] && driver=$scratch/hpipm/driver-skylake-x
        (cd "$problems" && "$driver" --ours "lpvmpc=$library" --ours "lpvmpc native=$native" --seconds 0.2 \
            --out "$results/1-hpipm-$size.csv" $(files "$size")) 2> "$scratch/hpipm-$size.log"
    done
    version() { cat "$sources/$1/COMMIT" 2> /dev/null || git -C "$sources/$1" rev-parse --short HEAD; }
    note+=" HPIPM $(version hpipm), BLASFEO $(version blasfeo): gcc -O2, X64_INTEL_HASWELL, for 16x6 \
X64_INTEL_SKYLAKE_X where the processor has it."
fi

step "wheels"
[[ -e $scratch/venv ]] || python3 -m venv "$scratch/venv"
"$scratch/venv/bin/pip" install --quiet --requirement requirements.txt
for size in 4x1 8x2 12x4 16x6; do
    (cd "$problems" && "$scratch/venv/bin/python" "$OLDPWD/compare.py" --library "$library" --seconds 0.1 \
        --out "$results/2-wheels-$size.csv" $(files "$size")) > "$scratch/wheels-$size.log"
done
note+=" Wheels: $(tr '\n' ' ' < requirements.txt)"

step "tables and figures"
"$scratch/venv/bin/python" tables.py "$results" --note "$note"
for horizon in 20 100; do
    "$scratch/venv/bin/python" figure.py "$results" "$horizon" "times-N$horizon.png"
done
step "done"
