#!/usr/bin/env bash
# The programs and the Python package ask for the same features of each dependency that they share (workspace-hack
# sees to it): else it would be compiled once for each of them.
set -euo pipefail
cd "$(dirname "$0")/.."

for program in ballbot-cli lpvmpc-cli lpvmpc-python; do
    cargo tree --locked --package "$program" --edges normal,build --prefix none --no-dedupe \
        --format "$program {p} {f}" | sed 's/ (.*)//' | sort -u
done | awk '
    { crate = $2 " " $3; asked[$1, crate] = asked[$1, crate] " [" $4 "]"; programs[$1]; crates[crate] }
    END {
        for (crate in crates) {
            split("", seen)
            for (program in programs) if ((program, crate) in asked) seen[asked[program, crate]] = program
            if (length(seen) > 1) {
                failed = 1
                for (set in seen) print "features of " crate " for " seen[set] ":" set
            }
        }
        if (failed) print "features: FAILED: add what differs to crates/workspace-hack/Cargo.toml"
        exit failed
    }
'
