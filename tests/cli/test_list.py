"""`auvid list`."""

import pytest

from auvid_cli.cli.start import Listed
from auvid_cli.config.enums import FilterName, shipped_files

from .conftest import auvid


@pytest.fixture
def listed(tmp_path):
    """Function: what is listed, by the heading's first word, as names and descriptions."""

    def run(*kinds: str) -> dict[str, list[list[str]]]:
        result = auvid("list", *kinds, cwd=tmp_path)
        assert result.exit_code == 0
        found: dict[str, list[list[str]]] = {}
        for line in result.stdout.splitlines():
            assert len(line) <= 120
            if line.startswith("  "):
                found[[*found][-1]].append(line.split(maxsplit=1))
            else:
                found[line.split()[0]] = []
        return found

    return run


def test_every_shipped_file_has_a_description(listed):
    found = listed()
    assert [*found] == [*Listed]
    assert [name for name, _ in found["filters"]] == [*FilterName]
    assert all(len(description) > 20 for rows in found.values() for _, description in rows)
    for kind in Listed:
        if kind is not Listed.FILTERS:
            assert [tuple(row) for row in found[kind]] == shipped_files(kind)


def test_list_of_one_kind(listed):
    assert [*listed("filters", "vehicles")] == ["filters", "vehicles"]


def test_unknown_kind_is_an_error(tmp_path):
    result = auvid("list", "filter", cwd=tmp_path)
    assert result.exit_code == 2
    assert "'filters'" in result.stderr
