"""The written functions against the compiled core. MATLAB is read by turning its few forms into Python."""

import re
import runpy
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.export.functions import matlab_text, python_text
from auvid_cli.export.unsupported_features import unsupported_features

seeds = st.integers(0, 2**32 - 1)


def read_python(text, folder):
    path = folder / "model.py"
    path.write_text(text, encoding="utf-8")
    return runpy.run_path(str(path))


def read_matlab(text):
    """The function as a Python one: comments off, rows to lists, ``a(i)`` to ``a[i - 1]``, ``A \\ b`` to solve."""
    text = "".join(line.split("%")[0] + "\n" for line in text.splitlines()).replace("...\n", "")
    heading, body = text.split("\n", 1)
    name, arguments = re.fullmatch(r"function derivative = (\w+)\((.*)\)\s*", heading).groups()
    body = body.rsplit("end", 1)[0]
    rows = re.search(r"MASS = \[(.*?)\]", body, re.DOTALL).group(1).split(";")
    mass = np.array([[float(number) for number in row.split()] for row in rows])
    body = body[body.index("W = ") :]
    body = re.sub(r"\b(motion|inputs|momentum)\((\d)\)", lambda m: f"{m[1]}[{int(m[2]) - 1}]", body)
    body = re.sub(r"= (\S+) \* \[(.*)\]", lambda m: f"= {m[1]} @ np.array([{m[2].replace(';', ',')}])", body)
    body = re.sub(r"= (\S+) \\ \[(.*)\]", lambda m: f"= np.linalg.solve({m[1]}, [{m[2].replace(';', ',')}])", body)
    body = re.sub(r"derivative = \[(\w+); (.*)\]", lambda m: f"derivative = [*{m[1]}, {m[2].replace(';', ',')}]", body)
    lines = "".join(f"    {line.strip().rstrip(';')}\n" for line in body.splitlines() if line.strip())
    scope = {"np": np, "sin": np.sin, "cos": np.cos, "MASS": mass}
    exec(f"def {name}({arguments}):\n{lines}    return derivative\n", scope)
    return name, scope[name]


def assert_same(actual, expected):
    assert_allclose(actual, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


@pytest.fixture(scope="module")
def python(skewed, tmp_path_factory):
    return read_python(python_text(skewed, unsupported_features(skewed), "model"), tmp_path_factory.mktemp("python"))


@pytest.fixture(scope="module")
def matlab(skewed):
    return read_matlab(matlab_text(skewed, unsupported_features(skewed), "my_model"))[1]


@given(seed=seeds)
def test_python_function_equals_the_core(seed, python, skewed, derivative_of, draw):
    motion, inputs = draw(seed)
    assert_same(python["motion_derivative"](motion, inputs), derivative_of(skewed, motion, inputs))


@given(seed=seeds)
def test_matlab_function_equals_the_core(seed, matlab, skewed, derivative_of, draw):
    motion, inputs = draw(seed)
    assert_same(matlab(motion, inputs), derivative_of(skewed, motion, inputs))


def test_functions_of_shipped_vehicles_equal_the_core(vehicle_file, model_with, derivative_of, draw, tmp_path):
    model = model_with(vehicle_file=vehicle_file)
    motion, inputs = draw(3)
    expected = derivative_of(model, motion, inputs)
    module = read_python(python_text(model, unsupported_features(model), "m"), tmp_path)
    assert_same(module["motion_derivative"](motion, inputs), expected)
    assert_same(read_matlab(matlab_text(model, unsupported_features(model), "m"))[1](motion, inputs), expected)


def test_python_module_needs_only_numpy(skewed):
    imports = re.findall(
        r"^(?:import|from) (\w+)", python_text(skewed, unsupported_features(skewed), "m"), re.MULTILINE
    )
    assert [name for name in imports if name not in sys.stdlib_module_names] == ["numpy"]


def test_python_module_has_uncertainties(model_with, tmp_path):
    model = model_with(held=("N_uudr",), not_identified=("Y_r|r|",))
    text = python_text(model, unsupported_features(model), "m")
    module = read_python(text, tmp_path)
    assert module["NOT_IDENTIFIED"] == ("Y_r|r|",)
    assert set(module["STANDARD_DEVIATION"]) == {c.symbol for c in model.coefficients} - {"N_uudr"}
    assert module["STANDARD_DEVIATION"]["X_u|u|"] == model.coefficients[0].standard_deviation
    assert re.search(r"^Y_rr = .*identified: false$", text, re.MULTILINE)
    assert re.search(r"^N_uudr = .*held, not estimated$", text, re.MULTILINE)


def test_functions_state_the_signs_of_the_fins(model_with, tmp_path):
    model = model_with()
    text = python_text(model, unsupported_features(model), "m")
    derivative = read_python(text, tmp_path)["motion_derivative"]
    straight = [2.0, *[0.0] * 8]
    turned = {fin: derivative(straight, given) for fin, given in (("r", [0.1, 0, 0, 0]), ("q", [0, 0.1, 0, 0]))}
    still = derivative(straight, [0, 0, 0, 0])
    side = "starboard" if turned["r"][5] > still[5] else "port"
    way = "up" if turned["q"][4] > still[4] else "down"
    stated = f"a positive rudder turns the bow to {side}; a positive elevator turns the bow {way}."
    assert stated in text
    assert stated in matlab_text(model, unsupported_features(model), "m")


def test_matlab_function_has_the_name_of_its_file(skewed):
    assert read_matlab(matlab_text(skewed, unsupported_features(skewed), "my_model"))[0] == "my_model"


def test_vehicle_name_never_ends_a_comment(model_with, tmp_path):
    model = model_with('vehicle.name="one\\ntwo = 3"')
    assert "\n" in model.experiment.vehicle.name
    assert "two" not in read_python(python_text(model, unsupported_features(model), "m"), tmp_path)
    read_matlab(matlab_text(model, unsupported_features(model), "m"))


def test_propulsion_terms_need_six_inputs(model_with, tmp_path, derivative_of, draw):
    terms = (
        '{name: X_n|n|, row: X, factors: [n, "|n|"], value: 0.3}',
        "{name: K_nV, row: K, factors: [n, voltage], value: 0.02}",
    )
    turns = "manoeuvre.propeller={revolutions: 20 turn/s, voltage: 24 V}"
    model = model_with(f"vehicle.terms=[{', '.join(terms)}]", turns)
    motion, inputs = draw(5)
    inputs = np.array([*inputs, -14.0, 22.0])
    expected = derivative_of(model, motion, inputs)
    text = python_text(model, unsupported_features(model), "model")
    assert_same(read_python(text, tmp_path)["motion_derivative"](motion, inputs), expected)
    _, function = read_matlab(matlab_text(model, unsupported_features(model), "model"))
    assert_same(np.asarray(function(motion, inputs), dtype=float), expected)
    assert "revolutions (turn/s), voltage (V)" in text
