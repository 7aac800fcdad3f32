"""The first cases of `benchmarks.attack`: whatever is damaged is answered in words, in time, and nothing is lost."""

import os

import pytest

from benchmarks.attack.kinds import KINDS
from benchmarks.attack.material import Material
from benchmarks.attack.pool import Worker
from benchmarks.attack.running import LIMIT
from benchmarks.attack.table import failures

# Those that draw figures take a second each.
COUNTS = {
    "settings": 2,
    "overrides": 4,
    "bytes": 3,
    "structure": 1,
    "logs": 4,
    "plans": 1,
    "links": 3,
    "environment": 1,
    "memory": 1,
    "limits": 2,
    "large": 1,
    "objects": 20,
}
SEED = 1

pytestmark = pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="the attack needs Linux")


@pytest.fixture(scope="module")
def worker(tmp_path_factory):
    home = tmp_path_factory.mktemp("attack")
    worker = Worker(home / "worker", Material(home / "material"), LIMIT, SEED)
    yield worker
    worker.close()


@pytest.mark.slow
@pytest.mark.parametrize("kind", COUNTS)
def test_damaged_input_is_answered_in_words_in_time_and_nothing_is_lost(kind, worker):
    outcomes = [worker.attack(kind, index) for index in range(COUNTS[kind])]
    failed = [outcome for outcome in outcomes if outcome.faults]
    assert not failed, failures(failed, f"python -m benchmarks.attack --seed {SEED}")


@pytest.mark.slow
def test_the_same_seed_gives_the_same_case(worker):
    one, other, another = (worker.attack("overrides", index) for index in (0, 0, 1))
    assert one.what == other.what != another.what
    assert set(COUNTS) < set(KINDS)
