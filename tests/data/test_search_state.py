"""State of a search for a manoeuvre in a file."""

import json

import pytest

from auvid_cli.data.findings import SearchState, read_search, write_search
from auvid_cli.errors import FileError

STATE = SearchState("k", 12.5, ((1.0, -2.5), (0.1, 3.0)))


def test_written_state_is_read_back(tmp_path):
    assert read_search(tmp_path / "search.json") is None
    write_search(tmp_path / "search.json", STATE)
    assert read_search(tmp_path / "search.json") == STATE


@pytest.mark.parametrize(
    "change",
    [
        {"kind": "other"},
        {"key": 5},
        {"elapsed": "long"},
        {"costs": []},
        {"costs": [[1.0], [1.0, 2.0]]},
        {"costs": [[]]},
        {"costs": [["x"]]},
        {"costs": [[float("nan")]]},
        {"costs": [[True]]},
    ],
    ids=str,
)
def test_invalid_state_is_refused(change, tmp_path):
    write_search(tmp_path / "search.json", STATE)
    held = json.loads((tmp_path / "search.json").read_text())
    (tmp_path / "search.json").write_text(json.dumps(held | change))
    with pytest.raises(FileError, match=r"search\.json.*damaged"):
        read_search(tmp_path / "search.json")


@pytest.mark.parametrize("content", [b"", b"[" * 100_000, b"[1]", b"\xff"], ids=["empty", "deep", "list", "no text"])
def test_file_without_json_object_is_refused(content, tmp_path):
    (tmp_path / "search.json").write_bytes(content)
    with pytest.raises(FileError, match=r"search\.json"):
        read_search(tmp_path / "search.json")
