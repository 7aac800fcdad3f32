"""Layout of text logs: delimiter, header and units; names for `ros2 topic echo --csv`, which writes no header."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from auvid_cli.config.log_columns import factor_if_known
from auvid_cli.config.log_map import LogFile
from auvid_cli.config.units import EXAMPLES, NUMBER
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LogColumn

_HEADER = ("header.stamp.sec", "header.stamp.nanosec", "header.frame_id")
_NANOSECONDS = 10**9  # nanoseconds in 1 s
MISSING_VALUES = ("", "nan", "NaN", "NAN", "-nan", "null", "NULL", "None", "N/A", "n/a", "NA", "-", "--")
_NOT_FINITE = re.compile(r"[-+]?(?:inf(?:inity)?|nan)", re.IGNORECASE)
# A letter directly after a number belongs to a name, such as "3D".
_WITH_UNIT = re.compile(
    r"(?P<number>[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?|nan|NaN)(?:\s+|(?=..|[sm%°]))"
    r"(?P<unit>[^\W\d].*|[%°].*)"
)
# SI units of quantities that vehicles log. A text with a unit of another quantity is treated as words.
_MEASURED = (*EXAMPLES, "dimensionless", "K", "Pa", "V", "A", "W", "T")
_NO_UNIT = ("", "-", "--")
_SLOCUM = "dbd_label:"
UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # byte order marks
COMMENT_MARKS = ("#", "%", "//")
FLAGS = {"true": 1.0, "false": 0.0}
BLANKS = " "
# In order of preference, because text may contain commas, and every row may contain blanks.
_DELIMITERS = (";", "\t", "|", ",", BLANKS)
_UNIT = re.compile(r"(?P<name>.*\S)\s*[(\[](?P<unit>[^()\[\]]*[^()\[\]\d][^()\[\]]*)[)\]]")
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")


def _vector(name: str, axes: str = "xyz") -> list[str]:
    return [f"{name}.{axis}" for axis in axes]


def _covariance(name: str, size: int) -> list[str]:
    return [f"{name}[{k}]" for k in range(size)]


# Fields after the header, by the number of columns of sensor_msgs and geometry_msgs with a stamp.
_TWIST = [*_vector("twist.linear"), *_vector("twist.angular")]
_FIELDS = {
    5: ["fluid_pressure", "variance"],
    6: _vector("vector"),
    7: _vector("quaternion", "xyzw"),
    9: _TWIST,
    40: [
        *_vector("orientation", "xyzw"),
        *_covariance("orientation_covariance", 9),
        *_vector("angular_velocity"),
        *_covariance("angular_velocity_covariance", 9),
        *_vector("linear_acceleration"),
        *_covariance("linear_acceleration_covariance", 9),
    ],
    45: [*(f"twist.{name}" for name in _TWIST), *_covariance("twist.covariance", 36)],
}


def ros_names(row: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the columns of a first row with stamp, frame and numbers; empty for other rows."""
    if len(row) not in _FIELDS or not (row[0].isdecimal() and row[1].isdecimal()) or NUMBER.fullmatch(row[2]):
        return ()
    is_stamp = int(row[1]) < _NANOSECONDS and all(NUMBER.fullmatch(field) for field in row[3:])
    return (*_HEADER, *_FIELDS[len(row)]) if is_stamp else ()


def is_number(field: str, decimal: str = ".", missing: Sequence[str] = ()) -> bool:
    """Whether a field is a number, or marks a missing number."""
    if field in MISSING_VALUES or field in missing:
        return True
    number = field.replace(decimal, ".")
    # Stricter than `float`, which accepts 1_000 and digits of other scripts.
    return bool(NUMBER.fullmatch(number) or _NOT_FINITE.fullmatch(number))


def split_unit(field: str) -> tuple[str, str]:
    """Return number and unit of a field; the whole field and an empty text if it has no such form."""
    match = _WITH_UNIT.fullmatch(field)
    return (match["number"], match["unit"]) if match else (field, "")


def find_suffix(values: Sequence[str], decimal: str, missing: Sequence[str]) -> str:
    """Return the first unit in cells that are all numbers with or without a unit; empty otherwise."""
    units = [split_unit(value)[1] for value in values if not is_number(value, decimal, missing)]
    return units[0] if units and all(map(is_unit, units)) else ""


def are_units(cells: Sequence[str], samples: Sequence[Sequence[str]]) -> bool:
    """Whether a row below the names has units: only units, or also words such as bool and a unit above numbers.

    `samples` are the cells below it, column by column.
    """
    units = [unit for unit in map(bare_unit, cells) if unit]
    if not units or any(is_number(unit) for unit in units):
        return False
    if all(map(is_unit, units)):
        return True
    below = zip(map(bare_unit, cells), samples, strict=False)
    return any(is_unit(unit) and holds_numbers(values) for unit, values in below)


def holds_numbers(values: Sequence[str]) -> bool:
    """Whether cells are numbers, with a decimal point or comma, and at least one is not missing."""
    given = [value for value in values if value not in MISSING_VALUES]
    return bool(given) and all(is_number(value) or is_number(value, ",") for value in given)


def bare_unit(cell: str) -> str:
    """Return the unit of a cell without brackets; empty if it states none."""
    unit = cell.strip("()[] ")
    return "" if unit in _NO_UNIT else unit


@cache
def is_unit(text: str) -> bool:
    """Whether a text is a unit of a quantity that vehicles log; a number is not."""
    return not is_number(text) and any(factor_if_known(text, measured) is not None for measured in _MEASURED)


def agreed_unit(where: str, heading: str, under: str, suffix: str) -> str:
    """Return the unit that heading, row of units and cells state; FileError (at `where`) if they disagree."""
    units = [unit for unit in (suffix, under, heading) if unit and is_unit(unit)]
    for measured in _MEASURED:
        if len({factor_if_known(unit, measured) for unit in units}) > 1:
            raise FileError(f"{where} has more than one unit: {', '.join(dict.fromkeys(units))}")
    return units[0] if units else heading


class Header(NamedTuple):
    """Layout of a text log."""

    delimiter: str
    decimal: str
    line: int  # last line of the header, from 1; 0 without a header
    names: tuple[str, ...]  # headings as they are written
    fields: int  # fields of each row: one more than columns if rows end with a delimiter
    columns: tuple[LogColumn, ...]  # one without a name has its number, such as ``#3``
    is_flag: tuple[bool, ...]  # whether the values of a column are "true" and "false"
    suffixes: tuple[str, ...]  # unit at the end of each cell of a column; empty without one


def split_row(line: str, delimiter: str) -> list[str]:
    """Return the fields of a row without surrounding blanks; an invalid row is one field."""
    if delimiter == BLANKS:
        return line.split()
    try:
        fields = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        # A carriage return inside, or a field of megabytes.
        return [line]
    return [field.strip() for field in fields]


def is_filler(line: str, delimiter: str) -> bool:
    """Whether a line is a comment, blank, or a row of empty fields."""
    return not line.replace(delimiter, "").strip() or line.lstrip().startswith(COMMENT_MARKS)


def read_header(path: Path, lines: Sequence[str], layout: LogFile) -> Header:
    """Return the layout of a text log from its first lines and the stated parts of it.

    Raises
    ------
    FileError
        If the lines are not a table, if names are missing, or if heading, row of units and cells state different units.
    """
    if layout.delimiter is not None and len(layout.delimiter) != 1:
        raise FileError(f"{path}: delimiter {layout.delimiter!r}; expected one character, such as ',' or '\\t'")
    delimiter = layout.delimiter or _find_delimiter(path, lines)
    given = layout.names or (() if layout.header_row else ros_names(split_row(lines[0], delimiter)))
    line = layout.header_row or (0 if given else _find_header(path, lines, delimiter))
    if line > len(lines):
        raise FileError(f"{path}:{line}: no header in this line; the log has {len(lines)} lines")
    names = list(given) or split_row(_uncomment(lines[line - 1]), delimiter)
    if all(map(is_number, names)):
        raise FileError(f"{path}:{line}: a row of numbers; expected names in the `header_row`")
    units = split_row(_uncomment(lines[line]), delimiter) if line < len(lines) else []
    below = _columns(list(_split_rows(lines[line + 1 :], delimiter).values()), len(names))
    has_units = len(units) >= len(names) and not given and are_units(units, below)
    # A Slocum glider writes the size of each number, bytes, below the units.
    last = line + has_units + (has_units and lines[0].startswith(_SLOCUM))
    # A logger that starts again writes its header again.
    rows = [row for row in _split_rows(lines[last:], delimiter).values() if row[: len(names)] != names]
    fields = _usual_length(rows) or len(names)
    ends_with_delimiter = fields == len(names) + 1 and all(row[-1] == "" for row in rows)
    if fields != len(names) and not ends_with_delimiter:
        if layout.names:
            raise FileError(f"{path}: {len(names)} `names` in the map for rows of {fields} fields")
        raise FileError(f"{path}:{line}: {len(names)} names above rows of {fields} fields")
    decimal = layout.decimal or _find_decimal(rows, delimiter)
    samples = _columns(rows, len(names))
    is_flag = tuple(_are_flags(values) for values in samples)
    suffixes = tuple(find_suffix(values, decimal, layout.missing) for values in samples)
    columns = []
    for k, (name, heading) in enumerate(_named(names)):
        under = bare_unit(units[k]) if has_units else ""
        unit = agreed_unit(f"{path}:{line + has_units}: {name!r}", heading, under, suffixes[k])
        numeric = is_flag[k] or suffixes[k] or all(is_number(v, decimal, layout.missing) for v in samples[k])
        columns.append(LogColumn(name, unit, is_text=not numeric))
    return Header(delimiter, decimal, last, tuple(names), fields, tuple(columns), is_flag, suffixes)


def _uncomment(line: str) -> str:
    return line.strip().lstrip("#%/").strip()


def _find_delimiter(path: Path, lines: Sequence[str]) -> str:
    """Return the delimiter that splits most lines into the same number of fields."""
    lengths = {delimiter: [len(row) for row in _split_rows(lines, delimiter).values()] for delimiter in _DELIMITERS}
    agreeing = {
        delimiter: max((lengths_of_rows.count(n) for n in {*lengths_of_rows} - {1}), default=0)
        for delimiter, lengths_of_rows in lengths.items()
    }
    delimiter = max(agreeing, key=lambda delimiter: agreeing[delimiter])
    if agreeing[delimiter] == 0:
        raise FileError(f"{path}: text without a delimiter; expected a table")
    return delimiter


def _split_rows(lines: Sequence[str], delimiter: str) -> dict[int, list[str]]:
    """Return the fields of lines that are not filler, by line number from 0."""
    return {k: split_row(line, delimiter) for k, line in enumerate(lines) if not is_filler(line, delimiter)}


def _usual_length(rows: Sequence[Sequence[str]]) -> int:
    """Return the most common number of fields."""
    return Counter(map(len, rows)).most_common(1)[0][0] if rows else 0


def _find_header(path: Path, lines: Sequence[str], delimiter: str) -> int:
    rows = _split_rows(lines, delimiter)
    usual = _usual_length(list(rows.values()))
    if usual < 2:
        raise FileError(f"{path}: the delimiter {delimiter!r} does not split its lines")
    first = next(k for k, row in rows.items() if len(row) == usual)
    fields = rows[first]
    if _are_names(fields, [row for row in rows.values() if len(row) == usual][1:]):
        return first + 1
    # Names above the numbers may be in a comment, or lack the delimiter at the end.
    above = [split_row(_uncomment(line), delimiter) for line in lines[max(first - 2, 0) : first]]
    fits = [len(names) in (len(fields), len(fields) - 1) for names in above]
    if len(above) == 2 and all(fits) and are_units(above[1], _columns(list(rows.values()), len(fields))):
        return first - 1
    if fits and fits[-1]:
        return first
    raise FileError(
        f"{path}:{first + 1}: a row of {len(fields)} fields and no names above it: add a line of names, or state the "
        "`names` of the log in the map"
    )


def _are_names(fields: Sequence[str], rows: Sequence[Sequence[str]]) -> bool:
    """Whether a row has names: not if all fields above numbers are numbers themselves."""
    numbers = [holds_numbers([field]) for field in fields]
    below = _columns(rows, len(fields))
    above_numbers = [number for number, cells in zip(numbers, below, strict=True) if holds_numbers(cells)]
    if any(above_numbers) and all(above_numbers):
        return False
    return 2 * sum(numbers) <= len(fields)


def _columns(rows: Sequence[Sequence[str]], number: int) -> list[list[str]]:
    """Return the cells of each column; rows may be too short."""
    return [[row[k] for row in rows if k < len(row)] for k in range(number)]


def _find_decimal(rows: Sequence[Sequence[str]], delimiter: str) -> str:
    if delimiter == ",":
        return "."
    fields = [field for row in rows for field in row]
    return "," if any(_DECIMAL_COMMA.fullmatch(split_unit(field)[0]) for field in fields) else "."


def _are_flags(values: Sequence[str]) -> bool:
    given = [value for value in values if value not in MISSING_VALUES]
    return bool(given) and all(value.lower() in FLAGS for value in given)


def _named(headings: Sequence[str]) -> list[tuple[str, str]]:
    """Return name and unit of each column; names are unique."""
    matches = [_UNIT.fullmatch(heading) for heading in headings]
    names = [match["name"] if match else heading for match, heading in zip(matches, headings, strict=True)]
    units = [match["unit"].strip() if match else "" for match in matches]
    # "Depth (m)" and "Depth (ft)" keep their whole headings.
    names = [name if names.count(name) == 1 else heading for name, heading in zip(names, headings, strict=True)]
    taken: set[str] = set()
    for k, name in enumerate(names):
        names[k] = name if name and name not in taken else f"{name} #{k + 1}".strip()
        taken.add(names[k])
    return list(zip(names, units, strict=True))
