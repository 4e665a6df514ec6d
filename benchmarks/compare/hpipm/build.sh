#!/usr/bin/env bash
# Builds BLASFEO, HPIPM and the driver from their sources, which are not part of this project:
#
#   build.sh SOURCES OUT
#
# SOURCES holds `blasfeo` and `hpipm` (github.com/giaf/blasfeo, github.com/giaf/hpipm), OUT gets
# `driver-haswell` and, on a processor with AVX-512, `driver-skylake-x`. What is there is kept.
set -euo pipefail
sources=$(realpath "$1")
mkdir -p "$2"
out=$(realpath "$2")
here=$(realpath "$(dirname "$0")")

library() { # name, target of BLASFEO, target of HPIPM
    local root=$out/$1
    [[ -e $root/hpipm/lib/libhpipm.a ]] && return
    mkdir -p "$root/sources"
    cp -r "$sources/blasfeo" "$sources/hpipm" "$root/sources"
    # No BLAS of its own: HPIPM calls BLASFEO's kernels. The flags are theirs: -O2 -fPIC.
    make -s -C "$root/sources/blasfeo" static_library install_static TARGET="$2" BLAS_API=0 PREFIX="$root"
    make -s -C "$root/sources/hpipm" static_library install_static TARGET="$3" \
        BLASFEO_PATH="$root/blasfeo" PREFIX="$root"
}

driver() { # name
    local root=$out/$1
    gcc -O3 -std=gnu11 -Wall -Wextra -Wno-unused-parameter -I"$here/../../capi/include" \
        -I"$root/blasfeo/include" -I"$root/hpipm/include" "$here"/*.c -o "$out/driver-$1" \
        "$root/hpipm/lib/libhpipm.a" "$root/blasfeo/lib/libblasfeo.a" -lm -ldl
}

library haswell X64_INTEL_HASWELL AVX > "$out/haswell.log" 2>&1
driver haswell
if grep -q avx512vl /proc/cpuinfo; then
    library skylake-x X64_INTEL_SKYLAKE_X AVX512 > "$out/skylake-x.log" 2>&1
    driver skylake-x
fi
