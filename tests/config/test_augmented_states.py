"""Blocks of further states, each with a name and settings."""

from pathlib import Path

import pytest

from auvid_cli.config import augmented_states


@pytest.mark.parametrize(
    ("line", "one_more"),
    [
        ('    THRUST = "thrust"\n', '    LAG = "lag"\n'),
        ("    thrust: ThrustScale = ThrustScale()\n", "    lag: ThrustScale = ThrustScale()\n"),
    ],
    ids=["a name without settings", "settings without a name"],
)
def test_a_block_that_is_half_there_is_refused_at_import(line, one_more):
    source = Path(augmented_states.__file__).read_text(encoding="utf-8")
    exec(source, {"__name__": "as_it_is"})
    with pytest.raises(TypeError, match="a name in BiasName and settings in AugmentedStates"):
        exec(source.replace(line, line + one_more), {"__name__": "changed"})
