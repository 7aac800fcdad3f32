"""Whatever a vehicle is called, and whatever its file says, nothing but data comes through."""

import ast
import io
import json
import re
import tokenize
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st

from auvid_cli.config.enums import FormatName
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.export.formats import (
    FORMATS,
    check_stem,
    file_stem,
    holoocean_text,
    json_text,
    simulator_text,
    yaml_text,
)
from auvid_cli.export.functions import matlab_text, mss_text, python_text
from auvid_cli.export.gazebo import gazebo_text, gazebo_unsupported
from auvid_cli.export.unsupported_features import unsupported_features

HOSTILE = (
    "  x\nimport os; os.system('true')\n#",
    "coding: utf-7 +AAo-import os",
    "-*- coding: latin-1 -*-",
    "a\rb\x0bc\x0cd\x85e\u2028f\u2029g",
    "%{\nsystem('true')\n%}",
    "x ...\n!true",
    "--><model name='other'/><!-- --- --",
    "]]> <b>&amp;&#0; \x00\x08\ufffe",
    "\u202eright to left\u202c \u200b\ufeff\x1b[2J\x9b2J",
    "--- !!python/object/apply:os.system ['true']\n...",
    '\'"""\\ {x} %s $x$ `id`',
)
# As YAML has them, without halves of pairs.
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=60) | st.sampled_from(HOSTILE)


def hostile(test):
    """Run a test with each of the names above, and with others."""
    for text in HOSTILE:
        test = example(text=text)(test)
    return settings(max_examples=25)(given(text=texts)(test))


def named(model, text):
    """The same model of a vehicle of that name, source and notes, and with such a source of an entry."""
    vehicle = model.experiment.vehicle
    parameters = vehicle.parameters.model_copy(
        update={"m": vehicle.parameters.m.model_copy(update={"source": text, "status": text})}
    )
    changed = {"name": text, "source": text, "notes": (text,), "parameters": parameters}
    experiment = model.experiment.model_copy(update={"vehicle": vehicle.model_copy(update=changed)})
    return type(model)(**vars(model) | {"experiment": experiment})


@pytest.fixture(scope="module")
def tame(model_with):
    return model_with(held=("X_u|u|",))


@pytest.mark.slow
@pytest.mark.parametrize("write", [python_text, holoocean_text, simulator_text])
@hostile
def test_python_module_differs_only_in_comments(text, write, tame):
    code, as_it_was = (write(model, unsupported_features(model), "m").encode() for model in (named(tame, text), tame))
    assert tokenize.detect_encoding(io.BytesIO(code).readline)[0] == "utf-8"
    assert ast.dump(ast.parse(code)) == ast.dump(ast.parse(as_it_was))
    exec(compile(code, "model.py", "exec"), {})


@pytest.mark.slow
@pytest.mark.parametrize("write", [matlab_text, mss_text])
@hostile
def test_matlab_function_differs_only_in_comments(text, write, tame):
    code, as_it_was = (
        [line for line in re.split(r"[\n\r\x0b\x0c\x85\u2028\u2029]", matlab) if not line.startswith("% ")]
        for model in (named(tame, text), tame)
        for matlab in [write(model, unsupported_features(model), "m")]
    )
    assert code == as_it_was


@pytest.mark.slow
@hostile
def test_vehicle_file_keeps_the_text(text, tame):
    held = yaml.safe_load(yaml_text(named(tame, text), unsupported_features(tame), "m"))
    assert (held["name"], held["source"], held["notes"][0]) == (text, text, text)
    assert held.keys() == VehicleSettings.model_fields.keys() - {"terms", "actuators"}
    assert held["parameters"]["m"]["source"] == text


@hostile
def test_gazebo_model_has_the_same_elements(text, tame):
    model = named(tame, text)
    written = gazebo_text(model, gazebo_unsupported(model), text)
    root, as_it_was = (
        ElementTree.fromstring(each) for each in (written, gazebo_text(tame, gazebo_unsupported(tame), "m"))
    )
    assert [(each.tag, each.text) for each in root.iter()] == [(each.tag, each.text) for each in as_it_was.iter()]
    assert written.isascii() or written.replace("\n", "").isprintable()


@pytest.mark.slow
@hostile
def test_json_keeps_the_text(text, tame):
    model = named(tame, text)
    held = json.loads(json_text(model, FORMATS[FormatName.JSON].unsupported(model), "m"))
    assert (held["vehicle"], held["provenance"]["settings"]["vehicle"]["notes"]) == (text, [text])


@hostile
def test_file_name_is_valid_for_every_format(text, tame):
    stem = file_stem(text * 9, "output_error")
    assert re.fullmatch("[a-z][a-z0-9_]*", stem)
    for name, form in FORMATS.items():
        check_stem(name, Path(f"{stem}{form.suffix}").stem)
