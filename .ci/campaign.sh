#!/usr/bin/env bash
# Campaigns and a tuning on real HyperQueue processes, on loopback: a worker and the server are killed
# (kill -9) in the middle, and the result is bit for bit that of one process. HyperQueue comes from
# PyPI, which has it as a Python module without the program `hq` and without a journal: .ci/hq.py takes
# its place. With the real one (in the PATH, or named by HQ) the server comes back from its journal.
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-$PWD/target}
ballbot=$target/release/ballbot
work=$target/campaign-show
[ -x "$ballbot" ] || cargo build --locked --release
rm -rf "$work"
mkdir -p "$work"

started=()
stop() { for id in "${started[@]}"; do kill -9 "$id" 2>/dev/null || true; done; }
trap stop EXIT
# Starts a process that is ended with the script, its output in the file $1.
start() { "${@:2}" >"$work/$1" 2>&1 & started+=($!); }
# Waits up to 60 s until the command says yes.
await() {
    for _ in $(seq 600); do
        "$@" && return
        sleep 0.1
    done
    echo "not after 60 s: $*" >&2
    return 1
}
shards() { find "$1/shards" -name 'shard-*.parquet' 2>/dev/null | wc -l; }
has_shards() { [ "$(shards "$1")" -ge "$2" ]; }
lines() { cat "$1/journal.jsonl" 2>/dev/null | wc -l; }
has_lines() { [ "$(lines "$1")" -ge "$2" ]; }
same() {
    for file in "${@:3}"; do
        cmp "$1/$file" "$2/$file"
    done
}

campaign=docs/examples/campaigns/delay-and-slope.toml
parts=16

echo "== one process"
"$ballbot" --quiet campaign "$campaign" --out "$work/whole"
"$ballbot" --quiet campaign replay "$campaign" --run 17 --out "$work/run"

echo "== a rare failure, and a share that is known well enough"
for name in rare-tilt known-share; do
    "$ballbot" campaign "docs/examples/campaigns/$name.toml" --out "$work/$name"
done

HQ=${HQ:-$(command -v hq || true)}
journal=(--host localhost --journal "$work/journal")
if [ -z "$HQ" ]; then
    python3 -m venv "$work/venv"
    "$work/venv/bin/pip" --quiet --disable-pip-version-check install hyperqueue
    HQ=$work/hq
    printf '#!/bin/sh\nexec "%s" "%s" "$@"\n' "$work/venv/bin/python" "$PWD/.ci/hq.py" >"$HQ"
    chmod +x "$HQ"
    journal=()
fi
export HQ HQ_SERVER_DIR=$work/server
start_server() {
    start "$1.txt" "$HQ" server start "${journal[@]}"
    server=${started[-1]}
    await test -e "$HQ_SERVER_DIR/hq-current/access.json"
}
start_worker() {
    start "$1.txt" "$HQ" worker start --cpus 1
    worker=${started[-1]}
}
on_cluster=(--cluster hyperqueue --server-dir "$HQ_SERVER_DIR")

echo "== a campaign on HyperQueue"
start_server server1
start_worker worker1
start_worker worker2
run=("$ballbot" --quiet campaign "$campaign" --shards "$parts" "${on_cluster[@]}" --out "$work/cluster")
start follower.txt "${run[@]}"
follower=${started[-1]}
await has_shards "$work/cluster" 3
kill -9 "$worker"
await has_shards "$work/cluster" 8
kill -9 "$server"
sleep 1 # for what the worker had begun
left=$(shards "$work/cluster")
[ "$left" -lt "$parts" ] || { echo "it was over before the server was killed" >&2; exit 1; }
if "$ballbot" campaign merge "$work/cluster" 2>"$work/missing.txt"; then
    echo "a campaign with missing shards was merged" >&2
    exit 1
fi
grep -q "are missing" "$work/missing.txt"
if [ "${#journal[@]}" = 0 ]; then
    # A server without a journal knows of no job: the client is asked anew.
    kill "$follower"
    rm -rf "$HQ_SERVER_DIR"
fi
start_server server2
start_worker worker3
if [ "${#journal[@]}" = 0 ]; then
    "${run[@]}"
else
    wait "$follower"
fi
same "$work/whole" "$work/cluster" runs.parquet runs.csv map.png
echo "a worker killed, then the server after $left shards: bit for bit what one process has"

echo "== a tuning on HyperQueue"
start_worker worker4
sed 's/^evaluations = .*/evaluations = 60/; s/^runs = 128$/runs = 32/' \
    docs/examples/tuning/paper.toml >"$work/tuning.toml"
tune=("$ballbot" --quiet tune "$work/tuning.toml")
"${tune[@]}" --out "$work/tuning"
tune+=(--shards 4 "${on_cluster[@]}" --out "$work/tuning-cluster")
start tuning.txt "${tune[@]}"
follower=${started[-1]}
await has_lines "$work/tuning-cluster" 10
kill -9 "$worker"
await has_lines "$work/tuning-cluster" 20
kill -9 "$follower"
left=$(lines "$work/tuning-cluster")
[ "$left" -lt "$(lines "$work/tuning")" ] || { echo "it was over before it was killed" >&2; exit 1; }
"${tune[@]}"
same "$work/tuning" "$work/tuning-cluster" journal.jsonl candidates.csv tuned.toml report.html front.png
[ ! -e "$work/tuning-cluster/batches" ]
echo "a worker killed, then the client after $left lines: bit for bit what one process has"
