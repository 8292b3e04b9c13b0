"""The examples of docstrings and of the README run."""

import doctest
import pathlib
import subprocess
import sys

import numpy
import pytest

import pbig

README = pathlib.Path(__file__).parent.parent / "README.md"


def examples():
    return [part.split("```")[0] for part in README.read_text().split("```python\n")[1:]]


def test_examples_of_docstrings_run():
    result = doctest.testmod(pbig, extraglobs={"pbig": pbig, "numpy": numpy})
    assert result.failed == 0 and result.attempted >= 12


def test_each_public_name_has_a_docstring():
    names = [getattr(pbig, name) for name in pbig.__all__ if name != "__version__"]
    methods = [method for name, method in vars(pbig.BroadPhase).items() if callable(method) and name != "__init__"]
    assert len(names) == 5 and len(methods) == 6
    assert all(named.__doc__ for named in names + methods)


@pytest.mark.parametrize("example", examples())
def test_examples_of_the_readme_run(example, tmp_path):
    if "import ipctk" in example:
        pytest.importorskip("ipctk")
    subprocess.run([sys.executable, "-c", example], cwd=tmp_path, check=True)


def test_the_readme_is_short_and_has_its_examples():
    assert len(README.read_text().splitlines()) <= 90 and len(examples()) >= 4


def test_types_are_installed():
    folder = pathlib.Path(pbig.__file__).parent
    assert (folder / "py.typed").exists() and (folder / "_pbig.pyi").exists()
