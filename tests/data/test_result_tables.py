"""Tables of results from CSV files, also from damaged ones."""

import pytest

from auvid_cli.data.checks import read_result_tables
from auvid_cli.errors import FileError

HEADER = "filter,coefficient,estimate\n"


def write(folder, text, name="coefficients"):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.csv").write_bytes(text if isinstance(text, bytes) else text.encode())


@pytest.mark.parametrize("place", ["tables", ".", "spiral/tables", "spiral"])
def test_tables_are_found_in_results_folder_and_copy(place, tmp_path):
    write(tmp_path / place, HEADER + "ckf,X_uu,-5\n")
    write(tmp_path / place, "filter,grade\nckf,sound\n", "summary")
    assert read_result_tables(tmp_path, "spiral") == {
        "coefficients": {("ckf", "X_uu"): {"estimate": "-5"}},
        "summary": {("ckf",): {"grade": "sound"}},
    }


def test_missing_tables_error_names_the_command(tmp_path):
    with pytest.raises(FileError, match="`auvid report`"):
        read_result_tables(tmp_path, "spiral")
    with pytest.raises(FileError, match="no such folder"):
        read_result_tables(tmp_path / "absent", "spiral")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", r"coefficients\.csv:1: .*filter, coefficient"),
        ("filter,estimate\n", "csv:1: .*coefficient"),
        ("filter,coefficient,filter\n", "csv:1: .*twice"),
        (HEADER + "ckf,X_uu\n", "csv:2: 2 cells; expected 3"),
        (HEADER + "ckf,X_uu,1\nckf,X_uu,1\n", "csv:3: .*second row of ckf X_uu"),
        (HEADER + '"ckf,X_uu,1\n', "not a CSV"),
        (HEADER.encode() + b"\xff,X,1\n", "UTF-8"),
        (b"\0" * 20_000_001, "too large"),
    ],
)
def test_damaged_table_is_refused_in_one_line(text, complaint, tmp_path):
    write(tmp_path, text)
    with pytest.raises(FileError, match=complaint) as caught:
        read_result_tables(tmp_path, "spiral")
    assert "\n" not in str(caught.value)
