"""From answers and times to the table, as Markdown and as JSON."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from statistics import median

import numpy as np

from benchmarks.peers.problem import N_COEFFICIENTS, Answer, Peer
from benchmarks.timing import Timed

_HEADER = (
    "filter",
    "library",
    "process",
    "events",
    "us per event",
    "min - max",
    "x auvid, same filter",
    "x auvid TUKF",
    "largest difference (sd)",
    "sd / auvid's",
)
_INTRODUCTION = """\
One problem on one core: the beginning of the default experiment, with 31 states. All filters start from the same prior.
The numbers are processor times per event, median of the rounds. An event is one prediction and the measurements at its
time. In each round all filters take turns. Made by `python -m benchmarks.peers`.
"""
_EXPLANATION = """\
`largest difference`: between the 22 final coefficients and those of auvid's filter of the same kind, in standard
deviations of the latter. `sd / auvid's`: smallest and largest ratio of the standard deviations. Ratios of times are
medians of the ratios within a round.

Quantities that do not depend on the state (Q, R, H, measurements by event) are prepared before the clock starts. auvid
also records mean, standard deviations, innovations and NIS of every event. Its sigma-point filters update with one
measurement after the other. The others keep only their last state, and use all measurements of an event at once.
"""


@dataclass(frozen=True)
class Entry:
    """A peer's answer, auvid's to the same events, and the times."""

    peer: Peer
    answer: Answer
    reference: Answer
    events: int
    first_run: float
    timed: Timed

    @property
    def per_event(self) -> tuple[float, ...]:
        """Return the microseconds of an event in each round."""
        return tuple(seconds / self.events * 1e6 for seconds in self.timed.seconds)


@dataclass(frozen=True)
class Row:
    """A line of the table; times in microseconds per event."""

    filter: str
    library: str
    process: str
    events: int
    microseconds: tuple[float, ...]
    first_run_seconds: float
    times_same_filter: float
    times_tukf: float
    difference: float
    deviation_ratio: tuple[float, float]
    is_reference: bool
    compiles: bool
    note: str

    @property
    def compilation(self) -> float:
        """Return by how much the first run takes longer than another, s."""
        return self.first_run_seconds - median(self.microseconds) * self.events * 1e-6


def compare(entry: Entry, same_filter: Entry, tukf: Entry) -> Row:
    """Write a line of the table."""
    peer, own = entry.peer, entry.per_event
    deviation = np.sqrt(np.diagonal(entry.reference.covariance))[:N_COEFFICIENTS]
    difference = np.abs(entry.answer.mean - entry.reference.mean)[:N_COEFFICIENTS] / deviation
    with np.errstate(invalid="ignore"):
        ratio = np.sqrt(np.diagonal(entry.answer.covariance))[:N_COEFFICIENTS] / deviation
    return Row(
        peer.name,
        peer.library,
        peer.process_model,
        entry.events,
        own,
        entry.first_run,
        median(a / b for a, b in zip(own, same_filter.per_event, strict=True)),
        median(a / b for a, b in zip(own, tukf.per_event, strict=True)),
        float(difference.max()),
        (float(ratio.min()), float(ratio.max())),
        entry is same_filter,
        peer.compiles,
        peer.note,
    )


def as_json(rows: Sequence[Row], environment: dict[str, str], remarks: Sequence[str]) -> str:
    """Return everything that was measured, round by round."""
    return json.dumps({"environment": environment, "rows": [asdict(row) for row in rows], "remarks": remarks}) + "\n"


def markdown(rows: Sequence[Row], environment: dict[str, str], remarks: Sequence[str]) -> str:
    """Write the table, what it was measured on, and what is to be said of it."""
    notes = list(dict.fromkeys(row.note for row in rows if row.note))
    compilations = [
        f"{row.library} {row.filter}: compilation takes {row.compilation:.1f} s more, again for each other number of "
        "events"
        for row in rows
        if row.compiles
    ]
    lines = [
        _INTRODUCTION,
        *(f"- {name}: {value}" for name, value in environment.items()),
        "",
        f"| {' | '.join(_HEADER)} |",
        f"| {' | '.join(['---'] * 3 + ['---:'] * (len(_HEADER) - 3))} |",
        *(f"| {' | '.join(_cells(row, notes))} |" for row in rows),
        "",
        *(f"- {line}" for line in [*remarks, *compilations]),
        "",
        _EXPLANATION,
        *(f"{number}. {note}" for number, note in enumerate(notes, 1)),
    ]
    return "\n".join(lines) + "\n"


def _cells(row: Row, notes: list[str]) -> list[str]:
    mark = f" [{notes.index(row.note) + 1}]" if row.note else ""
    smallest, largest = (f"{ratio:.4f}" for ratio in row.deviation_ratio)
    agreement = f"{row.difference:.1e}", smallest if smallest == largest else f"{smallest} - {largest}"
    return [
        row.filter + mark,
        row.library,
        row.process,
        str(row.events),
        _short(median(row.microseconds)),
        f"{_short(min(row.microseconds))} - {_short(max(row.microseconds))}",
        "1" if row.is_reference else _short(row.times_same_filter),
        _short(row.times_tukf),
        *(("", "") if row.is_reference else agreement),
    ]


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"
