"""Numbers and units as text logs write them: units in headings, in a row under them, or behind each number."""

import re
from collections.abc import Sequence
from functools import cache

from auvid_cli.config.log_columns import unit_factor
from auvid_cli.config.quantity import EXAMPLES, NUMBER
from auvid_cli.errors import FileError

MISSING_VALUES = ("", "nan", "NaN", "NAN", "-nan", "null", "NULL", "None", "N/A", "n/a", "NA", "-", "--")
_NO_FINITE = re.compile(r"[-+]?(?:inf(?:inity)?|nan)", re.IGNORECASE)
# A letter right behind a number is rather a name, as of a 3D fix.
_WITH_UNIT = re.compile(
    r"(?P<number>[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?|nan|NaN)(?:\s+|(?=..|[sm%°]))"
    r"(?P<unit>[^\W\d].*|[%°].*)"
)
# What vehicles log: a unit of anything else is taken for a word.
_MEASURED = (*EXAMPLES, "dimensionless", "K", "Pa", "V", "A", "W", "T")
_NO_UNIT = ("", "-", "--")


def is_number(field: str, decimal: str = ".", missing: Sequence[str] = ()) -> bool:
    """Say whether a field holds a number, or what stands for a missing one."""
    if field in MISSING_VALUES or field in missing:
        return True
    number = field.replace(decimal, ".")
    # Not whatever Python takes for a number: no program writes 1_000 or digits of other scripts.
    return bool(NUMBER.fullmatch(number) or _NO_FINITE.fullmatch(number))


def split_unit(field: str) -> tuple[str, str]:
    """Split a field into a number and the unit behind it; into all of it and nothing if it is no such number."""
    match = _WITH_UNIT.fullmatch(field)
    return (match["number"], match["unit"]) if match else (field, "")


def find_suffix(values: Sequence[str], decimal: str, missing: Sequence[str]) -> str:
    """Find the unit of the first cell that has one, if each of the others is a number, with a unit or without."""
    units = []
    for value in values:
        if not is_number(value, decimal, missing):
            _, unit = split_unit(value)
            if not unit or not is_unit(unit):
                return ""
            units.append(unit)
    return units[0] if units else ""


def are_units(cells: Sequence[str], samples: Sequence[Sequence[str]]) -> bool:
    """Say whether a row below the names holds units: nothing else, or words such as bool beside one above numbers.

    Parameters
    ----------
    cells : sequence of str
        Of that row.
    samples : sequence of sequence of str
        What stands below, column by column.
    """
    units = [unit for unit in map(bare_unit, cells) if unit]
    if not units or any(is_number(unit) for unit in units):
        return False
    if all(map(is_unit, units)):
        return True
    below = zip(map(bare_unit, cells), samples, strict=False)
    return any(is_unit(unit) and holds_numbers(values) for unit, values in below)


def holds_numbers(values: Sequence[str]) -> bool:
    """Say whether cells hold numbers, with a decimal point or comma, one of them at least, and nothing else."""
    given = [value for value in values if value not in MISSING_VALUES]
    return bool(given) and all(is_number(value) or is_number(value, ",") for value in given)


def bare_unit(cell: str) -> str:
    """Take the brackets off a cell below a name; empty if it states no unit."""
    unit = cell.strip("()[] ")
    return "" if unit in _NO_UNIT else unit


@cache
def is_unit(text: str) -> bool:
    """Say whether a text is a unit of anything that vehicles log; a number is none, although 1 may be stated as one."""
    return not is_number(text) and any(_size(text, measured) is not None for measured in _MEASURED)


def agreed_unit(where: str, heading: str, under: str, suffix: str) -> str:
    """Return the unit on which heading, row under it and cells agree, those of them that state a known one.

    Raises
    ------
    FileError
        If they state different ones; `where` says of which column.
    """
    known = [unit for unit in (suffix, under, heading) if unit and is_unit(unit)]
    for measured in _MEASURED:
        if len({_size(unit, measured) for unit in known}) > 1:
            raise FileError(f"{where} has more than one unit: {', '.join(dict.fromkeys(known))}")
    return known[0] if known else heading


def _size(text: str, unit: str) -> float | None:
    """Return the size of a unit in another one, if there is any."""
    try:
        return unit_factor(text, unit)
    except ValueError:
        return None
