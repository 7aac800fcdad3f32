"""Which coefficients an estimate, or its bound, knows only together."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.estimate import Estimate
from auvid_cli.report.notation import filter_label
from auvid_cli.report.page.parts import Matrix, Part, Words

Array = NDArray[np.float64]

# Pairs that are named, and the correlation from which on one is worth naming.
_MOST_PAIRS, _STRONG = 8, 0.7
# Members of a combination that are named: at least this share of the largest weight.
_LEAST_WEIGHT = 0.3


def correlation_of(estimate: Estimate) -> list[Part]:
    """Return the correlations of an estimate's coefficients at the last time, the strongest in words."""
    rows = estimate.coefficient_rows
    covariance = estimate.covariance[np.ix_(rows, rows)]
    deviation = np.sqrt(np.diag(covariance))
    if not rows or not (np.isfinite(covariance).all() and (deviation > 0.0).all()):
        return []
    values = covariance / np.outer(deviation, deviation)
    return correlation_parts(
        f"Correlations, {filter_label(estimate.filter)}", [estimate.state[i] for i in rows], values
    )


def correlation_parts(title: str, symbols: Sequence[str], values: Array) -> list[Part]:
    """Return a matrix of correlations, and its strongest combinations in words."""
    return [Words(_strongest(symbols, values), listed=True), Matrix(title, symbols, values)]


def _strongest(symbols: Sequence[str], values: Array) -> list[str]:
    upper = np.triu(np.abs(np.nan_to_num(values)), 1)
    order = np.argsort(-upper, axis=None)[:_MOST_PAIRS]
    pairs = [(int(i), int(j)) for i, j in zip(*np.unravel_index(order, upper.shape), strict=True)]
    named = [f"{symbols[i]} and {symbols[j]} {values[i, j]:+.2f}" for i, j in pairs if upper[i, j] >= _STRONG]
    sentences = [f"Strongest pairs: {', '.join(named)}." if named else f"No pair correlates by {_STRONG:g} or more."]
    if np.isfinite(values).all():
        variances, vectors = np.linalg.eigh(values)
        sentences.append(
            f"Least known together, each by its standard deviation: {_combination(symbols, vectors[:, -1])}; its "
            f"standard deviation is {np.sqrt(variances[-1]):.2g} times what it were if the errors were independent."
        )
        sentences.append(
            f"Best known together: {_combination(symbols, vectors[:, 0])}, {np.sqrt(max(variances[0], 0.0)):.2g} times."
        )
    return sentences


def _combination(symbols: Sequence[str], weights: Array) -> str:
    """Write the largest weights of a combination."""
    order = np.argsort(-np.abs(weights))
    largest = weights[order[0]]
    kept = [k for k in order if abs(weights[k]) >= _LEAST_WEIGHT * abs(largest)]
    signs = ["-" if weights[k] / largest < 0.0 else "+" for k in kept]
    sizes = ["" if k == order[0] else f"{abs(weights[k] / largest):.2g} " for k in kept]
    text = " ".join(f"{sign} {size}{symbols[k]}" for sign, size, k in zip(signs, sizes, kept, strict=True))
    return text.removeprefix("+ ")
