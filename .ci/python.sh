#!/usr/bin/env bash
# The Python package: built as a wheel by pip, installed where there is no Rust, its types checked, its
# tests run. What Python code needs comes from PyPI into target/python.
set -euo pipefail
cd "$(dirname "$0")/.."
# The same target folder: what the package shares with the program is not compiled twice.
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}
python=$CARGO_TARGET_DIR/python
rm -rf "$python"
mkdir -p "$python"

(cd python && cargo fmt --check && cargo clippy --locked --release -- -D warnings)

python3 -m venv "$python/venv"
pip=("$python/venv/bin/pip" --quiet --disable-pip-version-check)
"${pip[@]}" wheel --no-deps --wheel-dir "$python" ./python
# Without the compiler: a wheel needs none.
PATH=/usr/bin:/bin "${pip[@]}" install "$python"/lpvmpc-*.whl
"$python/venv/bin/python" -c 'import sys, lpvmpc
heavy = {"casadi", "matplotlib", "pandas", "sympy", "tqdm"} & set(sys.modules)
assert not heavy, f"import lpvmpc imports {heavy}"'

"${pip[@]}" install casadi matplotlib mypy pandas pytest scipy sympy tqdm
# The program that was built before says what the package must say, bit for bit.
export LPVMPC_BALLBOT=$CARGO_TARGET_DIR/release/ballbot
test -x "$LPVMPC_BALLBOT"
# With both named, it shares the dependencies of the other.
cargo build --locked --release -p ballbot-cli -p lpvmpc-cli --bin lpvmpc
export LPVMPC_PROGRAM=$CARGO_TARGET_DIR/release/lpvmpc
cd python
"$python/venv/bin/python" -m mypy
# Not `python -m pytest`, which would take the package of this folder instead of the installed one.
"$python/venv/bin/pytest" --quiet -p no:cacheprovider tests
