"""Several files as one log."""

from pathlib import Path

import numpy as np
import pytest

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import JoinedLog, Log, LogColumn
from auvid_cli.logs.formats.open_log import open_log


@pytest.fixture
def joined(tmp_path):
    """Three files of a recorder, of which the second has a column more."""
    (tmp_path / "1.csv").write_text("time,u (m/s),name\n0,1.0,a\n1,1.5,b\n")
    (tmp_path / "2.csv").write_text("time,u (m/s),name,extra\n2,2.0,a,7\n")
    (tmp_path / "3.csv").write_text("time,u (m/s),name\n3,2.5,a\n4,,c\n")
    return JoinedLog([open_log(tmp_path / f"{k}.csv") for k in (1, 2, 3)])


def test_rows_of_files_are_joined(joined):
    found = joined.read("", ["time", "u", "name"])
    assert np.array_equal(found["time"], [0.0, 1.0, 2.0, 3.0, 4.0])
    assert np.array_equal(found["u"], [1.0, 1.5, 2.0, 2.5, np.nan], equal_nan=True)
    assert list(found["name"]) == ["a", "b", "a", "a", "c"]


def test_joined_log_has_common_columns(joined):
    assert [column.name for column in joined.tables()[""]] == ["time", "u", "name", "@file"]
    assert {column.unit for column in joined.tables()[""]} == {"", "m/s"}
    with pytest.raises(FileError, match=r"1\.csv: no column named 'extra'"):
        joined.read("", ["extra"])


def test_file_column_numbers_files(joined):
    assert joined.read("", ["@file"])["@file"].tolist() == [1, 1, 2, 3, 3]


class CountedLog(Log):
    """A log of one table that counts how often it is asked what it holds."""

    asked = 0

    def tables(self):
        self.asked += 1
        return {"": (LogColumn("time"),)}

    def read(self, table, columns):
        return {name: np.arange(2.0) for name in columns}


def test_tables_of_parts_are_read_once():
    parts = [CountedLog(Path(f"{k}.csv")) for k in (1, 2)]
    log = JoinedLog(parts)
    for _ in range(3):
        assert log.tables()[""][0].name == "time"
        assert log.read("", ["time"])["time"].tolist() == [0, 1, 0, 1]
    assert [part.asked for part in parts] == [1, 1]


def test_other_units_raise_file_error(tmp_path):
    (tmp_path / "1.csv").write_text("time,r (deg/s)\n0,1.0\n")
    (tmp_path / "2.csv").write_text("time,r (rad/s)\n1,1.0\n")
    with pytest.raises(FileError, match=r"2\.csv: column 'r' is in rad/s.*deg/s"):
        JoinedLog([open_log(tmp_path / f"{k}.csv") for k in (1, 2)]).tables()
