#!/usr/bin/env bash
# A tuning, fresh and killed (kill -9) in the middle, then gone on with: bit for bit the same result. A
# journal that was changed is refused.
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-$PWD/target}
ballbot=$target/release/ballbot
work=$target/tuning-show
[ -x "$ballbot" ] || cargo build --locked --release
rm -rf "$work"
mkdir -p "$work"
sed 's/^evaluations = .*/evaluations = 150/; s/^runs = 128$/runs = 32/' \
    docs/examples/tuning/paper.toml >"$work/short.toml"
tune=("$ballbot" --quiet tune "$work/short.toml")
lines() { cat "$work/$1/journal.jsonl" 2>/dev/null | wc -l; }

"${tune[@]}" --threads 1 --out "$work/fresh"
"${tune[@]}" --out "$work/killed" & started=$!
trap 'kill -9 "$started" 2>/dev/null || true' EXIT
for _ in $(seq 600); do
    [ "$(lines killed)" -ge 20 ] && break
    sleep 0.05
done
kill -9 "$started"
wait "$started" 2>/dev/null || true
left=$(lines killed)
[ "$left" -ge 20 ] && [ "$left" -lt "$(lines fresh)" ] \
    || { echo "it was not killed in the middle: $left lines" >&2; exit 1; }
[ ! -e "$work/killed/report.html" ]
cp "$work/killed/journal.jsonl" "$work/changed.jsonl"
printf '%s' '0123 {"candidate":' >>"$work/killed/journal.jsonl" # a line that was being written
"${tune[@]}" --out "$work/killed"
for file in journal.jsonl candidates.csv tuned.toml report.html front.png; do
    cmp "$work/fresh/$file" "$work/killed/$file"
done
echo "killed after $left of $(lines fresh) lines: bit for bit what one process has"

mkdir "$work/changed"
sed '9s/"lost":0.0/"lost":0.1/' "$work/changed.jsonl" >"$work/changed/journal.jsonl"
if "${tune[@]}" --out "$work/changed" 2>"$work/changed.txt"; then
    echo "a journal that was changed was gone on with" >&2
    exit 1
fi
grep -q "line 9: it was changed" "$work/changed.txt"
