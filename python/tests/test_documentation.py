"""What the documentation shows is so."""

import doctest
import importlib
import pkgutil
import re
from pathlib import Path

import pytest

import lpvmpc

MODULES = [name for _, name, _ in pkgutil.iter_modules(lpvmpc.__path__) if name != "_lpvmpc"]


@pytest.mark.parametrize("name", ["__init__", *MODULES])
def test_examples_of_docstrings(name):
    module = lpvmpc if name == "__init__" else importlib.import_module(f"lpvmpc.{name}")
    assert doctest.testmod(module).failed == 0


def test_everything_public_is_described():
    for name in lpvmpc.__all__:
        thing = getattr(lpvmpc, name)
        assert thing.__doc__, name
        for member, value in vars(thing).items() if isinstance(thing, type) else ():
            if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                assert value.__doc__, f"{name}.{member}"


def test_code_of_the_readme(tmp_path, monkeypatch):
    import matplotlib

    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    text = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert blocks
    for block in blocks:
        exec(compile(block, "README.md", "exec"), {})
    matplotlib.pyplot.close("all")
