"""Parts that several pages share: verdicts, checks, correlations, provenance and rows of numbers."""

import platform
from collections.abc import Iterable, Sequence
from hashlib import sha256
from importlib.metadata import version

import numpy as np

from auvid_cli._version import __version__
from auvid_cli.arrays import Array
from auvid_cli.config.campaign import Campaign, dump_campaign
from auvid_cli.config.enums import JUDGE
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.identification import Use
from auvid_cli.config.loading import dump_experiment
from auvid_cli.data.checks import Check, NamedRows
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.estimate_checks import JUDGED
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.evaluation.judgement import Judgement
from auvid_cli.report.layout import NIS_MEANS
from auvid_cli.report.page.parts import Card, Cards, Listing, Matrix, Part, Section, TablePart, Words
from auvid_cli.report.sentences import Advice, advices, counts_in_words, shared_checks, whose
from auvid_cli.report.table import ERROR_DIGITS, Cell, Column, Symbol, Table, UnitCell, filter_label, number
from auvid_cli.text import sentence
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

_VERDICTS = {True: "pass", False: "FAIL", None: "note"}
_MAX_ADVICES = 6  # next to the cards; the list of checks has all advice
_LIBRARIES = ("numpy", "scipy", "numba", "h5py")
_MAX_PAIRS = 8  # number of listed pairs
_STRONG = 0.7  # smallest correlation of a listed pair
_MIN_WEIGHT = 0.3  # smallest listed weight of a combination, relative to the largest
_SYMBOLS = {*SYMBOLS, *MOTION_SYMBOLS}


def what_ran(dataset: Dataset, use: Use | None = None) -> str:
    """Return the duration of the data, the part of it that was used and, if simulated, the manoeuvre.

    `use` is that of the estimates; by default it is that of the dataset.
    """
    first, last, use = dataset.inputs.time[0], dataset.inputs.time[-1], use or dataset.experiment.identification.use
    duration = f"{last - first:.6g} s"
    used = sum(max(min(end, last) - max(begin, first), 0.0) for begin, end in use.spans)
    if use.longest_gap is not None or use.least_speed is not None:
        duration += " (parts used)"
    elif use.spans and used < last - first:
        duration += f" ({used:.6g} s used)"
    if dataset.truth is None or not isinstance(dataset.experiment, Experiment):
        return duration
    return f"{dataset.experiment.manoeuvre.type.replace('_', ' ')} of {duration}"


def provenance_section(dataset: Dataset) -> Section:
    """Return settings, versions and hashes that reproduce the numbers.

    Parameters
    ----------
    dataset : Dataset
        With the settings that count.
    """
    return _section(dump_experiment(dataset.experiment), "auvid run", dataset.sha256)


def campaign_provenance(campaign: Campaign) -> Section:
    """Return settings, versions and hashes that reproduce the runs of a campaign."""
    return _section(dump_campaign(campaign), "auvid campaign", "")


def _section(settings: str, command: str, of_dataset: str) -> Section:
    python = f"{platform.python_implementation()} {platform.python_version()}"
    rows = [
        *(["auvid", __version__], ["Python", f"{python} on {platform.system()} {platform.machine()}"]),
        *([name, version(name)] for name in _LIBRARIES),
        *([["SHA-256 of the dataset", of_dataset]] if of_dataset else []),
        ["SHA-256 of the settings", sha256(settings.encode()).hexdigest()],
    ]
    columns = Column("what", numeric=False), Column("value", numeric=False)
    table = Table("versions", "Versions and hashes", columns, [[*row] for row in rows])
    listing = Listing(f"Settings as YAML: save it, and give its path to {command}", settings)
    return Section("settings", "Settings, hashes, versions", [TablePart(table), listing])


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
    order = np.argsort(-upper, axis=None)[:_MAX_PAIRS]
    pairs = [(int(i), int(j)) for i, j in zip(*np.unravel_index(order, upper.shape), strict=True)]
    named = [f"{symbols[i]} and {symbols[j]} {values[i, j]:+.2f}" for i, j in pairs if upper[i, j] >= _STRONG]
    sentences = [f"Strongest pairs: {', '.join(named)}." if named else f"No pair correlates by {_STRONG:g} or more."]
    if np.isfinite(values).all():
        variances, vectors = np.linalg.eigh(values)
        sentences.append(
            f"Least certain combination, each in its standard deviation: {_combination(symbols, vectors[:, -1])}; its "
            f"standard deviation is {np.sqrt(variances[-1]):.2g} times that of independent errors."
        )
        sentences.append(
            f"Most certain combination: {_combination(symbols, vectors[:, 0])}, "
            f"{np.sqrt(max(variances[0], 0.0)):.2g} times."
        )
    return sentences


def _combination(symbols: Sequence[str], weights: Array) -> str:
    """Write the largest weights of a combination."""
    order = np.argsort(-np.abs(weights))
    largest = weights[order[0]]
    kept = [k for k in order if abs(weights[k]) >= _MIN_WEIGHT * abs(largest)]
    signs = ["-" if weights[k] / largest < 0.0 else "+" for k in kept]
    sizes = ["" if k == order[0] else f"{abs(weights[k] / largest):.2g} " for k in kept]
    text = " ".join(f"{sign} {size}{symbols[k]}" for sign, size, k in zip(signs, sizes, kept, strict=True))
    return text.removeprefix("+ ")


def table_of_rows(key: str, title: str, rows: NamedRows) -> Table:
    """Lay out rows with the names of their columns in words; those without any value are left out."""
    kept = [k for k in range(len(rows.columns)) if any(row[k] not in (None, "") for row in rows.rows)]
    columns = tuple(
        Column(rows.columns[k].replace("_", " "), numeric=all(_is_number(row[k]) for row in rows.rows)) for k in kept
    )
    return Table(key, title, columns, [[_cell(rows.columns[k], row[k]) for k in kept] for row in rows.rows])


def _is_number(value: object) -> bool:
    return value is None or (isinstance(value, (int, float)) and not isinstance(value, bool))


def _cell(column: str, value: object) -> Cell:
    match value:
        case None | int() | float() if not isinstance(value, bool):
            return value
        case bool():
            return "yes" if value else "no"
    text = str(value)
    return UnitCell(text) if column == "unit" else Symbol(text) if text in _SYMBOLS else text


def judgement_parts(evaluation: Evaluation, checks: Sequence[Check]) -> list[Part]:
    """Return a card with judgement and main numbers for each filter, and the advice of the checks.

    A verdict is one sentence with what to do.
    """
    judgements = evaluation.judgements()
    shared = shared_checks(check for check in checks if check.check != JUDGED)
    cards = []
    for row in evaluation.summary:
        numbers: dict[str, str | None] = {}
        if row.average_steady_state_error_percent is not None:
            error = number(row.average_steady_state_error_percent, ERROR_DIGITS + 1)
            numbers["average error"] = error and f"{error} %"
        for each in evaluation.consistency:
            if each.filter == row.filter:
                numbers[f"NIS of {each.sensor}"] = number(each.mean_nis, ERROR_DIGITS)
        numbers["processor time"] = f"{row.cpu_time_s:.2g} s"
        own = [each.check.passed for each in shared if row.filter in each.filters]
        shown = {name: text for name, text in numbers.items() if text}
        cards.append(judgement_card(row.filter, judgements[row.filter], shown, own.count(False), own.count(None)))
    names = [row.filter for row in evaluation.summary]
    sentences = [_in_words(advice, names) for advice in advices(shared)]
    if len(sentences) > _MAX_ADVICES:
        sentences[_MAX_ADVICES:] = [f"{len(sentences) - _MAX_ADVICES} more are in the list of checks below."]
    says: list[Part] = [Words(sentences, listed=True)] if sentences else []
    return [Cards(cards), *says, Words([NIS_MEANS])]


def judgement_card(
    filter_name: str, judgement: Judgement, numbers: dict[str, str], failed: int = 0, noted: int = 0
) -> Card:
    """Return the verdict on one filter, given how many checks failed or are worth knowing."""
    label = filter_label(filter_name)
    if judgement.advice:
        says = sentence(judgement.advice)
    elif failed:
        says = f"Judged sound, but {failed} check{'s' * (failed > 1)} failed: follow the advice below first."
    elif noted:
        says = f"Use the estimate, and read the {noted} note{'s' * (noted > 1)} of its checks below."
    else:
        says = "Use the estimate."
    return Card(label, filter_name, str(judgement.grade), says, numbers)


def _in_words(advice: Advice, names: Sequence[str]) -> str:
    """Return a failed or noted check, its estimators and the advice in one sentence."""
    found = f": {advice.shared[0].check.statistic}" if len(advice.shared) == 1 else ""
    verb = "Failed" if advice.failed else "Note"
    of = whose(advice.filters, names)
    return f"{verb} for {'all filters' if of == 'all' else of}: {advice.what}{found}. {advice.text}"


def check_parts(checks: Iterable[Check]) -> list[Part]:
    """Return the checks as tables: those that did not pass with their advice, and those that passed."""
    ordered = list(checks)
    if not ordered:
        return []
    names = list(dict.fromkeys(check.filter for check in ordered))
    filters = any(names)
    headers = ("verdict", *(["estimator"] if filters else []), "subject", "check", "found", "expected", "what to do")

    def row(check: Check, of: Sequence[str]) -> list[Cell]:
        return [
            _VERDICTS[check.passed],
            *([whose(of, names)] if filters else []),
            *(check.subject, check.check, check.statistic, check.threshold, check.advice),
        ]

    shared = [row(each.check, each.filters) for each in shared_checks(ordered)]
    passed = [row(check, [check.filter])[:-1] for check in ordered if check.passed]
    columns = tuple(Column(header, numeric=False) for header in headers)
    parts: list[Part] = [Words([f"{counted}." for counted in counts_in_words(ordered)])]
    if shared:
        notes = (
            ("Column found: value of the smoother, if it is in the row.",) if JUDGE in names and len(names) > 1 else ()
        )
        parts.append(
            TablePart(Table("noteworthy", "Failed or worth knowing", columns, shared, notes=notes), sortable=True)
        )
    if passed:
        table = Table("passed", f"Passed: {len(passed)}", columns[:-1], passed)
        parts.append(TablePart(table, sortable=True, folded=True))
    return parts
