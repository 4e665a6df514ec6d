#!/usr/bin/env bash
# Campaigns on real HyperQueue processes, on loopback: a worker and the server are killed (kill -9) in
# the middle, and the merged result is bit for bit that of one process. HyperQueue comes from PyPI,
# which has it as a Python module without the program `hq`, and without a journal. Where `hq` is there
# (in the PATH, or named by HQ), --cluster is shown, too, with a server that comes back from its
# journal.
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
# Waits up to 60 s until there are $2 shards in the folder $1.
shards() { find "$1/shards" -name 'shard-*.parquet' 2>/dev/null | wc -l; }
await_shards() {
    for _ in $(seq 600); do
        [ "$(shards "$1")" -ge "$2" ] && return
        sleep 0.1
    done
    echo "no $2 shards in $1 after 60 s" >&2
    return 1
}
same() {
    for file in runs.parquet runs.csv map.png; do
        cmp "$work/whole/$file" "$1/$file"
    done
    echo "$2: $(shards "$1") shards, bit for bit what one process has"
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

echo "== HyperQueue from PyPI"
python3 -m venv "$work/venv"
"$work/venv/bin/pip" --quiet --disable-pip-version-check install hyperqueue
python=("$work/venv/bin/python" .ci/campaign.py)
run=("${python[@]}" run "$work/server" "$ballbot" "$campaign" "$parts" "$work/python")
start server.txt "${python[@]}" server "$work/server"
server=$!
start worker.txt "${python[@]}" worker "$work/server"
worker=$!
start client.txt "${run[@]}"
await_shards "$work/python" 3
kill -9 "$worker"
await_shards "$work/python" 8
kill -9 "$server"
sleep 1 # for what the worker had begun
left=$(shards "$work/python")
[ "$left" -lt "$parts" ] || { echo "it was over before the server was killed" >&2; exit 1; }
if "$ballbot" campaign merge "$work/python" 2>"$work/missing.txt"; then
    echo "a campaign with missing shards was merged" >&2
    exit 1
fi
grep -q "are missing" "$work/missing.txt"
rm -rf "$work/server"
start server2.txt "${python[@]}" server "$work/server"
start worker2.txt "${python[@]}" worker "$work/server"
"${run[@]}" 2>/dev/null
"$ballbot" --quiet campaign merge "$work/python"
same "$work/python" "a worker killed, then the server after $left shards"

hq=${HQ:-$(command -v hq || true)}
if [ -n "$hq" ]; then
    echo "== --cluster hyperqueue, with $("$hq" --version)"
    export HQ=$hq HQ_SERVER_DIR=$work/hq
    server=("$hq" server start --host localhost --journal "$work/journal")
    start hq-server.txt "${server[@]}"
    first_server=$!
    sleep 1
    for name in worker1 worker2; do start "hq-$name.txt" "$hq" worker start --cpus 1; done
    worker=$!
    "$ballbot" --quiet campaign "$campaign" --shards "$parts" --cluster hyperqueue \
        --server-dir "$HQ_SERVER_DIR" --out "$work/hq-results" & follower=$!
    await_shards "$work/hq-results" 3
    kill -9 "$worker"
    await_shards "$work/hq-results" 8
    kill -9 "$first_server"
    start hq-server2.txt "${server[@]}"
    sleep 1
    start hq-worker3.txt "$hq" worker start --cpus 1
    wait "$follower"
    same "$work/hq-results" "a worker and the server killed"
fi
