"""Both functions for MATLAB as GNU Octave runs them; skipped where there is none. MSS itself is in no registry."""

import shutil
import subprocess

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FormatName
from auvid_cli.export.formats import FORMATS
from auvid_cli.export.functions import matlab_text, mss_text
from auvid_cli.export.unsupported_features import unsupported_features
from auvid_cli.vehicle.rigid_body import euler_rates, rotation_matrix

OCTAVE = shutil.which("octave-cli")
pytestmark = pytest.mark.skipif(OCTAVE is None, reason="needs GNU Octave")
CURRENT = (0.4, 2.0, -0.1)


@pytest.fixture(scope="module")
def cases(draw):
    return [draw(seed) for seed in range(6)]


@pytest.fixture(scope="module")
def results(skewed, cases, tmp_path_factory):
    """One row for each case: the bare function, the vessel in still water, and in a current with speed and mass."""
    assert OCTAVE is not None
    folder = tmp_path_factory.mktemp("octave")
    (folder / "bare.m").write_text(matlab_text(skewed, unsupported_features(skewed), "bare"), encoding="utf-8")
    (folder / "vessel.m").write_text(
        mss_text(skewed, FORMATS[FormatName.MSS].unsupported(skewed), "vessel"), encoding="utf-8"
    )
    script = ["format long"]
    for motion, inputs in cases:
        state = [*motion[:6], 1.0, 2.0, 3.0, *motion[6:]]
        m, x, ui = (f"[{' '.join(repr(float(value)) for value in values)}]" for values in (motion, state, inputs))
        vc = ", ".join(map(str, CURRENT))
        script.append(f"[xdot, U, M] = vessel({x}, {ui}, {vc}); still = vessel({x}', {ui}');")
        script.append(f"printf('%.17g ', [bare({m}, {ui}); still; xdot; U; M(:)]); printf('\\n');")
    command = [OCTAVE, "--norc", "--no-history", "--quiet", "--eval", "\n".join(script)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return np.array([[float(word) for word in line.split()] for line in done.stdout.splitlines()])


def assert_same(found, wanted):
    assert_allclose(found, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())


def test_octave_function_equals_the_core(results, cases, skewed, derivative_of):
    for row, (motion, inputs) in zip(results, cases, strict=True):
        assert_same(row[:9], derivative_of(skewed, motion, inputs))


def test_mss_vessel_equals_the_core(results, cases, skewed, derivative_of):
    for row, (motion, inputs) in zip(results, cases, strict=True):
        slope = derivative_of(skewed, motion, inputs)
        over_ground = rotation_matrix(motion[6:]) @ motion[:3]
        assert_same(row[9:21], np.concatenate([slope[:6], over_ground, slope[6:]]))


def test_mss_vessel_in_a_current_equals_the_core(results, cases, skewed, derivative_of):
    speed, whereto, down = CURRENT
    for row, (motion, inputs) in zip(results, cases, strict=True):
        rotation = rotation_matrix(motion[6:])
        current = rotation.T @ [speed * np.cos(whereto), speed * np.sin(whereto), down]
        through_water = np.concatenate([motion[:3] - current, motion[3:]])
        slope = derivative_of(skewed, through_water, inputs)[:6]
        # A current that is constant over ground seems to turn from aboard.
        slope[:3] -= np.cross(motion[3:6], current)
        rates = euler_rates(motion[None, 3:6], motion[None, 6:])[0]
        assert_same(row[21:33], np.concatenate([slope, rotation @ motion[:3], rates]))
        assert row[33] == pytest.approx(np.linalg.norm(motion[:3]), rel=1e-12)


def test_mss_vessel_returns_its_mass(results, skewed):
    parameters = skewed.experiment.vehicle.known_parameters()
    mass = results[0, 34:].reshape(6, 6)
    assert_allclose(mass, mass.T, rtol=1e-12)
    assert mass[0, 0] == pytest.approx(parameters["m"] - parameters["X_udot"])
