"""Two results folders beside each other."""

from pathlib import Path

from auvid_cli.data.result_tables import read_result_tables
from auvid_cli.evaluation.differences import DEVIATIONS, RELATIVE, Comparison, Tolerance, compare_tables

__all__ = ["DEVIATIONS", "RELATIVE", "Comparison", "Tolerance", "compare_results"]


def compare_results(first: Path, second: Path, tolerance: Tolerance) -> Comparison:
    """Compare the tables of two results folders; the second is the reference.

    Raises
    ------
    FileError
        If one has no tables, or a file is no such table.
    """
    names = first.resolve().name, second.resolve().name
    return compare_tables(read_result_tables(first, names[1]), read_result_tables(second, names[0]), tolerance)
