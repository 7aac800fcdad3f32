"""What a force may be made of: no product twice, none of the 22 again, and what a mirror leaves."""

import numpy as np
import pytest

from auvid_cli.vehicle.coefficients import COEFFICIENTS, SIGNALS, admissible_terms, term

MIRROR = {signal: -1.0 if signal in ("v", "p", "r", "rudder") else 1.0 for signal in SIGNALS}


def value(product, signals):
    """The product, for a vehicle that goes ahead."""
    factors = (abs(signals[f.strip("|")]) if f.startswith("|") else signals[f] for f in product.factors)
    return float(np.prod(list(factors)))


@pytest.fixture
def motions(rng):
    """Some motions ahead, none of them special."""
    return [
        dict(zip(SIGNALS, [abs(first), *rest], strict=True)) for first, *rest in rng.standard_normal((20, len(SIGNALS)))
    ]


@pytest.mark.parametrize("any_symmetry", [False, True])
def test_no_product_is_another_or_one_of_the_22(any_symmetry, motions):
    products = [*admissible_terms(any_symmetry), *COEFFICIENTS]
    seen = {(p.row, *(round(value(p, motion), 12) for motion in motions)) for p in products}
    # Of the 22, cross-flow drag and the rest are all different.
    assert len(seen) == len(products)


def test_a_mirrored_motion_mirrors_the_force(motions):
    mirrored = [{name: MIRROR[name] * x for name, x in motion.items()} for motion in motions]
    allowed = set(admissible_terms())
    for product in admissible_terms(any_symmetry=True):
        sign = -1.0 if product.row in (1, 3, 5) else 1.0
        same = all(value(product, b) == sign * value(product, a) for a, b in zip(motions, mirrored, strict=True))
        assert (product in allowed) == same, product.symbol


def test_candidates_contain_the_usual_terms():
    names = {product.symbol for product in admissible_terms()}
    assert {"Y_|v|r", "N_|v|r", "K_up", "K_p", "X_vv", "N_r", "M_q", "X_uu|rudder|"} <= names
    assert not {"X_v", "Y_|v|v", "N_ur", "Y_w"} & names


def test_no_name_is_that_of_another_in_code():
    names = [product.identifier for product in (*admissible_terms(), *COEFFICIENTS)]
    assert "M_ww_even" in names
    assert not {name for name in names if names.count(name) > 1 and name.endswith("_even")}
    assert term(5, ("|v|", "r")).symbol == "N_|v|r"
