"""The versions that were tested are those of what is depended on."""

import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LINES = (ROOT / ".ci/constraints.txt").read_text(encoding="utf-8").splitlines()
TESTED = {canonicalize_name(name): version for name, _, version in (line.partition("==") for line in LINES)}


@pytest.mark.parametrize("text", [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["test"]])
def test_every_dependency_was_tested_in_a_version_that_it_allows(text):
    required = Requirement(text)
    tested = TESTED.get(canonicalize_name(required.name))
    assert tested is not None, "run .ci/run --write-constraints"
    assert required.specifier.contains(tested)
