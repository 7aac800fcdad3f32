"""A REMUS 100 and short runs of it."""

import pytest

from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.config.manoeuvre import Envelope
from auvid_cli.design.problem import Requirement


@pytest.fixture(scope="session")
def remus():
    """Function: the shipped REMUS 100 with overrides."""
    return lambda *overrides: load_experiment(find_experiment("remus100"), overrides)


@pytest.fixture
def requirement():
    """Function: a requirement of 20 s and two vehicles, with limits or other changes."""

    def make(limits=None, **changes):
        few = Requirement(20.0, Envelope(**(limits or {})), None, None, (), "D", 2, None)
        return few._replace(**changes)

    return make
