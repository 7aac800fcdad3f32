from pathlib import Path

from auvid_cli.config.source_positions import ConfigSource, Mistake, Position, mistakes_text

SOURCE = ConfigSource("a.yaml", Path(), "name: x\n\tlong: " + "y" * 300 + "\n\x1b[31mred: 1\n")


def test_message_has_line_with_caret():
    mistake = Mistake(Position(SOURCE, 1, 7), ("name",), "wrong")
    assert mistakes_text([mistake]) == "a.yaml:1:7: name: wrong\n    1 | name: x\n      |       ^"


def test_mistakes_are_sorted_and_share_the_excerpt():
    at, later = Position(SOURCE, 1, 1), Position(SOURCE, 2, 8)
    lines = mistakes_text(
        [Mistake(later, (), "third"), Mistake(at, (), "first"), Mistake(at, (), "second")]
    ).splitlines()
    assert [line.split(": ")[-1] for line in lines[:2]] == ["first", "second"]
    assert lines[2] == "    1 | name: x"
    assert lines[4] == "a.yaml:2:8: third"


def test_tab_is_kept_before_the_caret():
    assert mistakes_text([Mistake(Position(SOURCE, 2, 2), (), "x")]).splitlines()[-1] == "      | \t^"


def test_long_line_is_cut_around_the_column():
    _, line, caret = mistakes_text([Mistake(Position(SOURCE, 2, 200), (), "x")]).splitlines()
    assert len(line) < 120
    assert caret.index("^") < len(line)


def test_control_characters_are_replaced():
    assert "\x1b" not in mistakes_text([Mistake(Position(SOURCE, 3, 1), ("\x1b[0m",), "x")])


def test_override_has_no_excerpt():
    assert mistakes_text([Mistake(Position(ConfigSource("--set a=b", Path())), ("a",), "wrong")]) == "--set a=b: wrong"


def test_key_inside_override_is_named():
    inner = Mistake(Position(ConfigSource("--set a={b: 1}", Path())), ("a", "b"), "wrong")
    assert mistakes_text([inner]) == "--set a={b: 1}: a.b: wrong"


def test_many_and_long_mistakes_are_shortened():
    source = ConfigSource("a.yaml", Path(), "x: 1\n" * 1000)
    text = mistakes_text(Mistake(Position(source, k, 1), ("x" * 100_000,), "wrong") for k in range(1, 1001))
    assert text.endswith("\nand 950 more mistakes")
    assert len(text) < 120_000
