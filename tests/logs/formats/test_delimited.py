"""Delimited text of many makes, against the numbers that were written into it."""

import gzip

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from auvid_cli.config.log_map import LogFile
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LogColumn
from auvid_cli.logs.formats.open_log import open_log


@pytest.fixture
def opened(tmp_path):
    """Function: a log of that text, opened."""

    def write(text, name="log.csv", encoding="utf-8", **layout):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        return open_log(path, LogFile(**layout))

    return write


def read(log, *names):
    values = log.read("", names)
    assert list(values) == list(names)
    return [found.tolist() for found in values.values()]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("time,depth\n1.5,2\n3,4e-1\n", "commas"),
        ("time;depth\n1,5;2\n3;4e-1\n", "semicolons and decimal commas"),
        ("time\tdepth\r\n1.5\t2\r\n3\t4e-1\r\n", "tabs and carriage returns"),
        ("time|depth\n1.5|2\n3|4e-1", "bars, and no line feed at the end"),
        ("time   depth\n 1.5  2\n 3  4e-1\n", "blanks"),
        ("Vehicle: Iver\nrecorded, in Florida, in 2021\n\ntime,depth\n1.5,2\n3,4e-1\n", "a preamble"),
        ("# by a logger\ntime,depth\n# switched on\n1.5,2\n\n,\n3,4e-1\n// off\n", "comments and empty rows"),
        ("# time,depth\n1.5,2\n3,4e-1\n", "names in a comment"),
        ("time,depth\n1.5,2,\n3,4e-1,\n", "rows that end with a delimiter"),
        ("time,depth,\n1.5,2,\n3,4e-1,\n", "lines that end with a delimiter"),
        ("\ufefftime ,depth  \n 1.5 ,2 \n3, 4e-1\n", "a byte order mark and blanks around"),
        ('"time","depth"\n"1.5","2"\n"3","4e-1"\n', "quotation marks"),
    ],
    ids=lambda value: value if "\n" not in value else "",
)
def test_layout_is_detected(opened, text, what):
    assert read(opened(text), "time", "depth") == [[1.5, 3.0], [2.0, 0.4]], what


def test_stated_layout_overrides_detected(opened):
    log = opened("a,b\n1,2\ntime,depth\n3,4\n5,ERR\n", header_row=3, missing=("ERR",))
    assert read(log, "time") == [[3.0, 5.0]]
    np.testing.assert_array_equal(log.read("", ["depth"])["depth"], [4.0, np.nan])
    assert read(opened("a;b,c\n1;2,3\n", delimiter=",", decimal="."), "c") == [[3.0]]


def test_units_are_taken_from_the_headings(opened):
    text = "Time(s),Depth (m),speed [m/s],x[0],DVL-Depth (m),Depth (ft),Temp (°C) ,\n1,2,3,4,5,6,7,8\n2,2,3,4,5,6,7,8\n"
    assert opened(text).tables() == {
        "": (
            LogColumn("Time", "s"),
            LogColumn("Depth (m)", "m"),
            LogColumn("speed", "m/s"),
            LogColumn("x[0]"),
            LogColumn("DVL-Depth", "m"),
            LogColumn("Depth (ft)", "ft"),
            LogColumn("Temp", "°C"),
            LogColumn("#8"),
        )
    }


@pytest.mark.parametrize(
    "text",
    [
        "time,roll,note\ns,deg,\n0.5,1,dive\n1,-2.5,turn\n",
        "# time,roll,note\n# [s],[deg],-\n0.5,1,dive\n1,-2.5,turn\n",
        "by a logger\ntime;roll;note\n(s);(deg);(-)\n0,5;1;dive\n1;-2,5;turn\n",
        "time,roll,note\n0.5s,1 deg,dive\n1.0s, -2.5deg ,turn\n",
        "time;roll (deg);note\ns;;\n0,5;1 deg;dive\n1;-2,5 deg;turn\n",
        'time,roll,note\ns,deg,-\n0.5,1 deg,dive,\n"1",-2.5e0 deg,turn,\n',
    ],
)
def test_units_in_own_row_or_cells_are_read(opened, text):
    log = opened(text)
    assert log.tables()[""] == (LogColumn("time", "s"), LogColumn("roll", "deg"), LogColumn("note", is_text=True))
    assert read(log, "time", "roll", "note") == [[0.5, 1.0], [1.0, -2.5], ["dive", "turn"]]


@pytest.mark.slow
def test_units_in_cells_continue_beyond_head(opened):
    rows = "".join(f"{k / 8} s,{k} %,{k / 4} m/s\n" for k in range(101_000))
    log = opened(f"t,share,u\n{rows}0 s,n/a,\n1 s,,nan m/s\n")
    assert [column.unit for column in log.tables()[""]] == ["s", "%", "m/s"]
    share, speed = log.read("", ["share", "u"]).values()
    np.testing.assert_array_equal(share, [*range(101_000), np.nan, np.nan])
    np.testing.assert_array_equal(speed, [*(np.arange(101_000) / 4), np.nan, np.nan])


@pytest.mark.parametrize("row", ["ok,auto", "10:31:54,5 apples", "2021-06-09,dive 3", "1,3D"])
def test_words_are_not_units(opened, row):
    log = opened(f"a,b\n{row}\n{row}\n")
    assert log.tables()[""][1] == LogColumn("b", is_text=True)
    assert read(log, "b") == [[row.split(",")[1]] * 2]


def test_columns_of_same_name_get_numbers(opened):
    assert read(opened("t,t,u\n1,2,3\n4,5,6\n"), "t", "t #2", "u") == [[1, 4], [2, 5], [3, 6]]


@pytest.mark.parametrize("time", ["54:20.5", "10:31:54.25", "2021-06-09T10:31:54Z", "2021-06-09 10:31:54"])
def test_times_as_text_stay_text(opened, time):
    log = opened(f"clock, u\n{time} ,1\n{time},2\n")
    assert log.tables()[""] == (LogColumn("clock", is_text=True), LogColumn("u"))
    assert read(log, "u", "clock") == [[1.0, 2.0], [time, time]]


def test_missing_numbers_are_nan_and_flags_are_numbers(opened):
    log = opened("t,u,valid\n1,,True\n2,NaN,FALSE\n3,n/a,\n4,1.5,true\n")
    values = log.read("", ["u", "valid"])
    np.testing.assert_array_equal(values["u"], [np.nan, np.nan, np.nan, 1.5])
    np.testing.assert_array_equal(values["valid"], [1.0, 0.0, np.nan, 1.0])


def test_a_delimiter_within_quotation_marks_divides_nothing(opened):
    assert read(opened('t,note,u\n1,"left, then right",2\n3,none,4\n'), "note", "u") == [
        ["left, then right", "none"],
        [2.0, 4.0],
    ]


@pytest.mark.slow
def test_latin_1_is_understood_wherever_it_begins(opened):
    late = "t,note\n" + "1,plain\n" * 40_000 + "2,größer\n"
    assert read(opened(late, encoding="latin-1"), "note")[0][-1] == "größer"
    assert opened("t,Temp (°C)\n1,2\n", encoding="latin-1").tables()[""][1] == LogColumn("Temp", "°C")


def test_compressed_text_reads_like_plain(opened):
    assert read(opened(gzip.compress(b"t,u\n1,2\n3,4\n"), name="log.csv.gz"), "t", "u") == [[1, 3], [2, 4]]


def test_a_log_without_rows_is_empty(opened):
    assert read(opened("t,u\n"), "t", "u") == [[], []]


@pytest.mark.slow
@given(
    arrays(np.float64, (7, 3), elements=st.floats(allow_nan=False)),
    st.sampled_from([",", ";", "\t", "|", " "]),
    st.booleans(),
)
def test_numbers_come_back_to_the_last_digit(tmp_path_factory, values, delimiter, decimal_comma):
    decimal = "," if decimal_comma and delimiter != "," else "."
    rows = [delimiter.join(repr(float(value)).replace(".", decimal) for value in row) for row in values]
    path = tmp_path_factory.mktemp("logs") / "log.csv"
    path.write_text("\n".join([delimiter.join("abc"), *rows]) + "\n")
    found = open_log(path, LogFile(delimiter=delimiter, decimal=decimal)).read("", ["a", "b", "c"])
    np.testing.assert_array_equal(np.column_stack(list(found.values())), values)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("t,u\n1,2\n3\n5,6\n", r"log\.csv:3: row with 1 fields.*2"),
        ("t,u\n1,2\n\n3,4,5\n5,6\n", r"log\.csv:4: row with 3 fields.*2"),
        ("t,u\n" + "1,2\n# note\n" * 101_000 + "3,oops\n", r"log\.csv:202002: 'u' is 'oops'.*number"),
        ("t,ok\n" + "1,true\n" * 20_000 + "3,perhaps\n", r"log\.csv:20002: 'ok' is 'perhaps'.*true or"),
        ("t,u\n1,2 m/s\n2,3 m/s\n3,4 knot\n", r"log\.csv:4: 'u' is '4 knot'.*m/s"),
        ("t,u\n" + "1,2 s\n" * 101_000 + "3,4 ms\n", r"log\.csv:101002: 'u' is '4 ms'.*in s"),
        ("t,u\n1,2 m/s\n\n# note\n3,4\n", r"log\.csv:5: 'u' is '4'.*m/s"),
        ("t,u\ns,knot\n1,2 m/s\n", r"log\.csv:2: 'u' has more than one unit: m/s, knot"),
        ("t,u\ns,m/s\n1,oops\n2,3\n4\n", r"log\.csv:5: row with 1 fields.*2"),
        ("t,u\n1,2\n3,4\n\0\0\0\0", r"log\.csv:4: zero bytes"),
        ("t,u\n" + "1,2\n" * 50_000 + "3,5_0\n", r"log\.csv:50002: 'u' is '5_0'.*number"),
        ("t,u\n" + "1,2\n" * 50_000 + "3,\u0665\n", r"log\.csv:50002: 'u' is '\u0665'.*number"),
        ("t,u\n1,2\n3," + "5" * 200_000 + ",6\n", r"log\.csv:3: row with 1 fields"),
        ("t,u\n1,2\n3,4\r5,6\n7,8\n", r"log\.csv:3: row with 1 fields"),
        ("t," + "u" * 200_000 + "\n1,2\n3,4\n", r"log\.csv:1: a line of more than 128 kB.*names"),
        ("1,2\n3,4\n", r"log\.csv:1: .*2 fields and no names"),
        ("just\nwords\n", r"log\.csv: text without a delimiter"),
    ],
)
def test_invalid_row_raises_file_error_with_line(opened, text, complaint):
    with pytest.raises(FileError, match=complaint):
        opened(text).read("", text.split("\n")[0].split(","))


def test_open_quotation_mark_raises_file_error(opened):
    with pytest.raises(FileError, match="quotation mark"):
        read(opened('t,note,u\n1,"open,2\n3,4,5\n6,7,8\n'), "u")


def test_missing_column_raises_file_error_with_nearest(opened):
    with pytest.raises(FileError, match=r"no column named 'Deepth'.*'Depth'"):
        opened("Time (s),Depth (m)\n1,2\n2,2\n").read("", ["Deepth"])
    with pytest.raises(FileError, match="no table named 'dvl'"):
        opened("t,u\n1,2\n").read("dvl", ["u"])


@pytest.mark.slow
def test_a_compressed_log_cut_short_is_an_error(tmp_path):
    path = tmp_path / "log.csv.gz"
    text = "t,u\n" + "".join(f"{k},{k**7 % 1013}\n" for k in range(20_000))
    path.write_bytes(gzip.compress(text.encode())[:-400])
    with pytest.raises(FileError, match="cannot be read"):
        open_log(path).read("", ["t"])


def test_a_first_row_of_ones_is_no_row_of_units(opened):
    assert read(opened("time,u,v\n1,1,1\n2,1,1\n"), "time", "u") == [[1.0, 2.0], [1.0, 1.0]]


def test_other_digits_are_text(opened):
    assert opened("t,u\n1,\u0665\n2,5_0\n").tables()[""][1] == LogColumn("u", is_text=True)


@pytest.mark.slow
def test_endless_line_raises_file_error(tmp_path):
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(b"t,u\n1,2\n" + b"5" * (1 << 27), compresslevel=1))
    with pytest.raises(FileError, match="a line of more than 64 MB"):
        open_log(tmp_path / "log.csv.gz").read("", ["t"])


def test_header_row_of_numbers_raises_file_error(opened):
    with pytest.raises(FileError, match=r"log\.csv:2: a row of numbers.*`header_row`"):
        opened("time,u\n1,2\n3,4\n", header_row=2)


@pytest.mark.parametrize(
    ("name", "there"),
    [("spped", "'speed' (nearest of 7)"), ("zzz", "'time', 'speed', 'b1', 'b2', 'b3' (first of 7)")],
)
def test_missing_name_states_number_of_names(opened, name, there):
    with pytest.raises(FileError) as caught:
        opened("time,speed,b1,b2,b3,b4,b5\n1,2,3,4,5,6,7\n").read("", [name])
    assert str(caught.value).endswith(f"no column named {name!r}; expected {there}")


@pytest.mark.parametrize("word", ["bool", "text", "nodim", ""])
def test_a_row_of_units_may_hold_words_that_are_none(opened, word):
    log = opened(f"time,depth,flag,mode\ns,m,{word},string\n1,2,true,dive\n3,4,false,climb\n")
    assert log.tables()[""][1] == LogColumn("depth", "m")
    assert read(log, "depth", "flag", "mode") == [[2.0, 4.0], [1.0, 0.0], ["dive", "climb"]]


def test_a_row_of_text_below_names_is_no_row_of_units(opened):
    """Although m, of a mode, is a unit as well."""
    log = opened("time,mode\n0:01,m\n0:02,dive\n0:03,m\n")
    assert read(log, "mode") == [["m", "dive", "m"]]


ALOG = "0.10 NAV_X uSim 12.5\n0.20 NAV_X uSim 12.6\n0.30 MODE pHelm DRIVE\n"


def test_first_row_of_data_is_not_names(opened):
    with pytest.raises(FileError, match=r"log\.csv:1: .*no names.*`names`"):
        opened(ALOG)


@pytest.mark.parametrize("above", ["", "# by a logger\n"])
def test_names_of_a_log_without_a_header_are_stated(opened, above):
    log = opened(above + ALOG, names=("time", "what", "who", "value"))
    assert read(log, "time", "what") == [[0.1, 0.2, 0.3], ["NAV_X", "NAV_X", "MODE"]]


def test_stated_names_take_the_place_of_others(opened):
    assert read(opened("a,b\n1,2\n3,4\n", names=("time", "u"), header_row=1), "u") == [[2.0, 4.0]]


def test_wrong_number_of_stated_names_raises_file_error(opened):
    with pytest.raises(FileError, match=r"3 `names`.*2 fields"):
        opened("1,2\n3,4\n", names=("time", "u", "v"))


def test_text_of_a_slocum_glider_is_read(opened):
    log = opened(
        "dbd_label: DBD_ASC(dinkum_binary_data_ascii)file\nencoding_ver: 2\nsensors_per_cycle: 3\n"
        "m_present_time m_depth c_fin \ntimestamp m rad \n8 4 4 \n1.5e9 NaN 0.1 \n1500000002 3.5 NaN \n"
    )
    assert [column.unit for column in log.tables()[""]] == ["", "m", "rad"]
    np.testing.assert_array_equal(log.read("", ["m_depth"])["m_depth"], [np.nan, 3.5])


def test_cut_last_row_is_left_out_and_named(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,u,v\n0,1,2\n1,3,4\n2,5")
    log = open_log(path)
    assert log.read("", ["u"])["u"].tolist() == [1.0, 3.0]
    assert log.remarks() == ("the last row is cut short: left out",)


@pytest.mark.parametrize("text", ["t,u,v\n0,1,2\n1,3\n2,5,6\n", "t,u,v\n0,1,2\n1,3\n", "t,u,v\n0,1,2\n1,3,4,5"])
def test_other_row_of_wrong_length_raises_file_error(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(FileError, match=r"log\.csv:3: row with"):
        open_log(path).read("", ["u"])
