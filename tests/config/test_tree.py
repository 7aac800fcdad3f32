from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from auvid_cli.config.source_positions import ConfigSource, Position, Tree, read_tree

TEXT = """\
# comment
name: a
dvl:
  rate: 7 Hz
  noise: [1, 2e-3]
"""


def read(text: str) -> Tree:
    tree, mistakes = read_tree(ConfigSource("f.yaml", Path(), text))
    assert not mistakes
    return tree


def only_mistake(text: str) -> str:
    _, (mistake,) = read_tree(ConfigSource("f.yaml", Path(), text))
    return str(mistake)


def where(position: Position | None) -> tuple[int, int]:
    assert position is not None
    return position.line, position.column


def test_data_is_plain():
    assert read(TEXT).data == {"name": "a", "dvl": {"rate": "7 Hz", "noise": [1, "2e-3"]}}


@pytest.mark.parametrize(
    ("path", "key", "value"),
    [(("name",), (2, 1), (2, 7)), (("dvl", "rate"), (4, 3), (4, 9)), (("dvl",), (3, 1), (4, 3))],
)
def test_key_and_value_have_positions(path, key, value):
    *_, node = read(TEXT).descend(path)
    assert where(node.key_at) == key
    assert where(node.at) == value


def test_list_entry_has_position():
    *_, node = read(TEXT).descend(("dvl", "noise", 1))
    assert (node.content, where(node.at)) == ("2e-3", (5, 14))
    assert node.at.excerpt().splitlines()[1] == "    5 |   noise: [1, 2e-3]"


def test_descend_stops_at_missing_key():
    assert len(list(read(TEXT).descend(("dvl", "speed", "x")))) == 2


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("a: &x {b: 1, c: 2}\nd: *x\n", {"a": {"b": 1, "c": 2}, "d": {"b": 1, "c": 2}}),
        ("a: &x {b: 1, c: 2}\nd: {<<: *x, c: 3}\n", {"a": {"b": 1, "c": 2}, "d": {"b": 1, "c": 3}}),
        (
            "a: &x {b: 1}\ne: &y {b: 2, c: 2}\nd: {<<: [*x, *y]}\n",
            {"a": {"b": 1}, "e": {"b": 2, "c": 2}, "d": {"b": 1, "c": 2}},
        ),
    ],
)
def test_anchors_and_merge_keys_are_resolved(text, data):
    assert read(text).data == data


def test_keys_are_text_as_written():
    assert read("on: 1\n2: 3\n").data == {"on": 1, "2": 3}


def test_duplicate_key_keeps_first_value():
    tree, (mistake,) = read_tree(ConfigSource("f.yaml", Path(), "a:\n  b: 1\n  b: 2\n"))
    assert tree.data == {"a": {"b": 1}}
    assert str(mistake) == "f.yaml:3:3: a.b: duplicate key 'b' (first in line 2)"


@pytest.mark.parametrize(
    ("text", "start"),
    [
        ("a:\n\tb: 1\n", "f.yaml:2:1: not valid YAML: a tab"),
        ("a: [1\nb: 2\n", "f.yaml:2:2: not valid YAML: while parsing a flow sequence"),
        ("a: 'x\n", "f.yaml:2:1: not valid YAML: while scanning a quoted scalar"),
        ("a: 1\n---\nb: 2\n", "f.yaml:2:1: not valid YAML: expected a single document"),
        ("a: !!python/object/apply:os.system [ls]\n", "f.yaml:1:4: not valid YAML: the tag"),
        ("a: !!python/name:os.system x\n", "f.yaml:1:4: not valid YAML: the tag"),
        ("a: !!bool foo\n", "f.yaml:1:4: not valid YAML: the tag '!!bool' is not allowed"),
        ("a: !!int ''\n", "f.yaml:1:4: not valid YAML: the tag '!!int' is not allowed"),
        ("a: !!float ''\n", "f.yaml:1:4: not valid YAML: the tag '!!float' is not allowed"),
        ("a: !!timestamp x\n", "f.yaml:1:4: not valid YAML: the tag '!!timestamp' is not allowed"),
        ('a: "b\\ud800"\n', "f.yaml:1:4: not valid YAML: half of a character"),
        ("!!int x: 1\n", "f.yaml:1:1: not valid YAML: the tag '!!int' is not allowed"),
        ("a: 5_0\n", "f.yaml:1:4: not valid YAML: '5_0': underscore in a number"),
        ("a: -1_0.5e-1\n", "f.yaml:1:4: not valid YAML: '-1_0.5e-1': underscore"),
        (f"a: {'9' * 5000}\n", "f.yaml:1:4: not valid YAML: " + "9" * 60 + " ...: too many digits"),
        ("a: &x [*x]\n", "f.yaml:1:4: not valid YAML: an alias to a value that contains it"),
        ("a: {[1]: 2}\n", "f.yaml:1:5: not valid YAML: a key must be a plain word"),
        ("a: {<<: 2}\n", "f.yaml:1:9: not valid YAML: only a mapping can be merged"),
        ("a: \udcff\n", "f.yaml:1:4: not UTF-8 text: byte 0xff"),
        ("a: 1\nb: \x07\n", "f.yaml:2:4: character U+0007 is not allowed"),
        ("[" * 5000, "f.yaml:1:52: not valid YAML: nested too deeply"),
    ],
)
def test_invalid_yaml_is_reported(text, start):
    assert only_mistake(text).startswith(start)


def test_many_aliases_are_refused():
    levels = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    levels += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
    assert "more than 10000 values" in only_mistake("\n".join(levels))


def test_deeply_nested_aliases_are_refused():
    levels = ["a0: &a0 [1]", *(f"a{i}: &a{i} [*a{i - 1}]" for i in range(1, 60))]
    assert "nested too deeply" in only_mistake("\n".join(levels))


@pytest.mark.slow
def test_too_many_values_are_refused():
    assert "more than 10000 values" in only_mistake("\n".join(f"key{i}: 1" for i in range(90_000)))


@pytest.mark.parametrize("written", ["010", "1:30", "0x10", "0b1", "2020-01-01", "2020-13-45", "5_kg", "'5_0'", "="])
def test_ambiguous_scalar_is_text(written):
    assert read(f"a: {written}\n").data == {"a": written.strip("'")}


@given(st.text(st.characters(max_codepoint=126), max_size=60))
def test_any_text_is_read_or_refused(text):
    read_tree(ConfigSource("f.yaml", Path(), text))


def test_put_returns_copy():
    tree = read(TEXT)
    new = Tree(9, Position(ConfigSource("--set", Path())))
    assert tree.put(("dvl", "noise", "0"), new).data["dvl"]["noise"] == [9, "2e-3"]
    assert tree.put(("x", "y"), new).data["x"] == {"y": 9}
    assert tree.data == read(TEXT).data


@pytest.mark.parametrize("path", [("name", "x"), ("dvl", "noise", "2"), ("dvl", "noise", "-1"), ("dvl", "noise", "x")])
def test_put_through_scalar_or_missing_entry_raises(path):
    with pytest.raises(ValueError, match=r"cannot set|no entry"):
        read(TEXT).put(path, Tree(9, Position(ConfigSource("--set", Path()))))


SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
DATA = st.recursive(SCALARS, lambda inner: st.lists(inner) | st.dictionaries(st.text("abcxyz|_", min_size=1), inner))


@pytest.mark.slow
@given(st.dictionaries(st.text("abc", min_size=1), DATA))
@settings(max_examples=15)
def test_data_agrees_with_safe_loader(data):
    assert read(yaml.safe_dump(data)).data == yaml.safe_load(yaml.safe_dump(data))
