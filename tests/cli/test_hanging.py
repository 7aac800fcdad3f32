"""Lines on a narrow terminal."""

import os

from auvid_cli.cli import hanging
from auvid_cli.cli.terminal import Terminal

LINE = "  vehicles/lauv.yaml  LAUV, 1.1 m, 18 kg: its linear damping is folded into the 22 coefficients."


def test_line_without_terminal_is_not_broken():
    assert hanging(LINE, 22) == LINE


def test_line_on_terminal_has_hanging_indent(monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setattr("auvid_cli.cli.get_terminal_size", lambda: os.terminal_size((60, 20)))
    first, *others = hanging(LINE, 22).splitlines()
    assert first.startswith("  vehicles/lauv.yaml  LAUV,")
    assert others
    assert all(line.startswith(22 * " ") and line[22] != " " and len(line) <= 60 for line in (*others,))
    assert " ".join([first.strip(), *(line.strip() for line in others)]) == LINE.strip()


def test_long_word_is_not_broken(monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setattr("auvid_cli.cli.get_terminal_size", lambda: os.terminal_size((20, 20)))
    path = "/a/folder/of/a/long/name/dataset.h5"
    assert path in hanging(f"{path}: 40 s of spiral", 2).splitlines()[0]


def test_sentence_breaks_only_between_words(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setattr("auvid_cli.cli.get_terminal_size", lambda: os.terminal_size((40, 20)))
    sentence = "dataset.h5: samples: accelerometer 30001, attitude 30001, dvl 2101"
    Terminal(quiet=False, verbose=False).print_wrapped(sentence)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 1
    assert all(len(line) <= 40 for line in lines)
    assert " ".join(line.strip() for line in lines) == sentence
