"""Lines on a narrow terminal."""

import os

from auvid_cli.cli.hanging import hanging

LINE = "  vehicles/lauv.yaml  LAUV, 1.1 m, 18 kg: its linear damping is folded into the 22 coefficients."


def test_a_line_stays_one_where_nobody_looks():
    assert hanging(LINE, 22) == LINE


def test_on_a_terminal_it_goes_on_under_its_last_column(monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setattr("auvid_cli.cli.hanging.get_terminal_size", lambda: os.terminal_size((60, 20)))
    first, *others = hanging(LINE, 22).splitlines()
    assert first.startswith("  vehicles/lauv.yaml  LAUV,")
    assert others
    assert all(line.startswith(22 * " ") and line[22] != " " and len(line) <= 60 for line in (*others,))
    assert " ".join([first.strip(), *(line.strip() for line in others)]) == LINE.strip()
