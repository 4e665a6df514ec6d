"""What the documentation shows is so."""

import doctest
import importlib
import pkgutil
import re
from pathlib import Path

import pytest

import lpvmpc

MODULES = [name for _, name, _ in pkgutil.walk_packages(lpvmpc.__path__, "lpvmpc.") if name != "lpvmpc._lpvmpc"]


@pytest.mark.parametrize("name", ["lpvmpc", *MODULES])
def test_examples_of_docstrings(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_everything_public_is_described():
    public = {name: getattr(module, name) for module in (lpvmpc, lpvmpc.ballbot) for name in module.__all__}
    for name, thing in public.items():
        assert thing.__doc__, name
        own = [kind for kind in getattr(thing, "__mro__", ()) if kind.__module__.startswith("lpvmpc")]
        for member, value in (one for kind in own for one in vars(kind).items()):
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
