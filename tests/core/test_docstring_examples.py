"""The example in the docstring of each public name: it is there, and it runs."""

import doctest
import inspect
import sys
from pathlib import Path

import pytest

import wks_segment.core as core

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", core.__all__)
def test_the_example_of_a_public_name_runs(name, monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT))
    text = inspect.getdoc(vars(sys.modules[getattr(core, name).__module__])[name])
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert example.examples, f"{name} has no example"
    told = []
    doctest.DocTestRunner(verbose=False).run(example, out=told.append)
    assert not told, "".join(told)
