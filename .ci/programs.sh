#!/usr/bin/env bash
# What later steps run, built in one go and as they build it: crates side by side that would wait for each other
# one program at a time. Without `ballbot` itself, which has the page inside; with it named, all share its dependencies.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo build --locked --release -p ballbot-cli -p lpvmpc-cli -p ballbot-scenario \
    --bin lpvmpc --example count_steps --example firmware_check
