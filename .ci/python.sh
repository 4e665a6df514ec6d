#!/usr/bin/env bash
# The Python package: built as a wheel by pip, installed where there is no Rust, its types checked, its
# tests run. What Python code needs comes from PyPI into target/python.
set -euo pipefail
cd "$(dirname "$0")/.."
. .ci/beside.sh
# The same target folder: what the package shares with the program is not compiled twice.
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}
python=$CARGO_TARGET_DIR/python
rm -rf "$python"
mkdir -p "$python"
pip() { "$python/$1/bin/pip" --quiet --disable-pip-version-check "${@:2}"; }

# What the tests need, and the types, which are checked in the sources: while the wheel is compiled.
packages() {
    python3 -m venv "$python/venv"
    pip venv install casadi matplotlib mypy numpy pandas pytest pytest-xdist scipy sympy tqdm
    cd python
    "$python/venv/bin/python" -m mypy
}
beside "packages and types" packages

# Alone with what it depends on. Without the compiler: a wheel needs none.
python3 -m venv "$python/alone"
pip alone wheel --no-deps --wheel-dir "$python" ./python
PATH=/usr/bin:/bin pip alone install "$python"/lpvmpc-*.whl
"$python/alone/bin/python" -c 'import sys, lpvmpc
heavy = {"casadi", "matplotlib", "pandas", "sympy", "tqdm"} & set(sys.modules)
assert not heavy, f"import lpvmpc imports {heavy}"'

# The program that was built before says what the package must say, bit for bit.
export LPVMPC_BALLBOT=$CARGO_TARGET_DIR/release/ballbot
test -x "$LPVMPC_BALLBOT"
# With both named, it shares the dependencies of the other.
cargo build --locked --release -p ballbot-cli -p lpvmpc-cli --bin lpvmpc
export LPVMPC_PROGRAM=$CARGO_TARGET_DIR/release/lpvmpc

finish "packages and types"
PATH=/usr/bin:/bin pip venv install "$python"/lpvmpc-*.whl
cd python
# Not `python -m pytest`, which would take the package of this folder instead of the installed one.
# In two processes, each with a half of the files until it helps the other; then, alone, what takes times or is
# interrupted.
pytest=("$python/venv/bin/pytest" --quiet -p no:cacheprovider tests)
"${pytest[@]}" --numprocesses 2 --dist worksteal -m "not alone"
"${pytest[@]}" -m alone
