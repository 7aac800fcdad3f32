"""Judgements, checks and a search for a model as sentences; several estimates can share one."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from auvid_cli.config.enums import JUDGE
from auvid_cli.config.extra_states import BiasName
from auvid_cli.data.checks import Check
from auvid_cli.evaluation.accuracy import coefficient_results
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.fitting.results import Fit, FitStep
from auvid_cli.report.table import Cell, Column, Table, filter_label, tabulated, text_column
from auvid_cli.text import sentence
from auvid_cli.validation.results import Score, verdict_on

_COUNTED = {False: "failed", None: "noted"}
# Excitation of each motion whose coefficients can be held.
_EXCITATION = {
    "the vertical plane": "dive and climb with clear movements of the elevator",
    "the horizontal plane": "turn to both sides with clear movements of the rudder",
    "roll": "change the roll moment, and record the roll rate",
}
_COEFFICIENTS_OF = "coefficients of "


def judgement_sentences(judgements: Mapping[str, Judgement], with_sound: bool) -> list[str]:
    """Return sentences with judgement, reason and remedy, one for all filters that share them.

    Parameters
    ----------
    judgements : mapping of Judgement
        By filter.
    with_sound : bool
        Whether sound estimates are named as well.
    """
    labels: dict[Judgement, list[str]] = {}
    for name, judgement in judgements.items():
        if with_sound or judgement.grade is not Grade.SOUND:
            labels.setdefault(judgement, []).append(filter_label(name))
    return [sentence(f"{', '.join(of_same)} {judgement}") for judgement, of_same in labels.items()]


def score_sentences(scores: Sequence[Score]) -> list[str]:
    """Return a sentence for each score of a validation, and whether the model is recommended."""
    return [*(f"{score}." for score in scores), *filter(None, [verdict_on(scores)])]


def contradiction_sentences(checks: Iterable[Check]) -> list[str]:
    """Return a sentence on failed checks of an accelerometer that was not used."""
    found = ", ".join(f"{check.check}: {check.statistic}" for check in checks)
    text = "the unused accelerometer contradicts the DVL ({}): run `auvid inspect` before you use it"
    return [sentence(text.format(found))] if found else []


class SharedCheck(NamedTuple):
    """A check that did not pass, and the estimates that share it."""

    check: Check  # check of the smoother if it is among them, else of the first estimate
    filters: tuple[str, ...]


class Advice(NamedTuple):
    """Advice that several checks share."""

    shared: tuple[SharedCheck, ...]  # all failed, or all are notes; of the same estimates
    text: str

    @property
    def failed(self) -> bool:
        """Whether the checks failed."""
        return self.shared[0].check.passed is False

    @property
    def filters(self) -> tuple[str, ...]:
        """Return the estimates that share the advice."""
        return self.shared[0].filters

    @property
    def what(self) -> str:
        """Return the names of the checks."""
        names: dict[str, list[str]] = {}
        for entry in self.shared:
            names.setdefault(entry.check.subject, []).append(entry.check.check)
        return joined_words([f"{subject} ({', '.join(checks)})" for subject, checks in names.items()])


def shared_checks(checks: Iterable[Check]) -> list[SharedCheck]:
    """Return the checks that did not pass, failures first, once for all estimates with the same result and advice."""
    alike: dict[tuple[str, str, bool | None, str], list[Check]] = {}
    for check in checks:
        if not check.passed:
            alike.setdefault((check.subject, check.check, check.passed, check.advice), []).append(check)
    shared = [
        SharedCheck(
            next((entry for entry in group if entry.filter == JUDGE), group[0]),
            tuple(entry.filter for entry in group),
        )
        for group in alike.values()
    ]
    return sorted(shared, key=lambda entry: entry.check.passed is None)


def advices(shared: Iterable[SharedCheck]) -> list[Advice]:
    """Return each advice once, with the checks that share it."""
    alike: dict[tuple[str, bool | None, tuple[str, ...]], list[SharedCheck]] = {}
    for entry in shared:
        alike.setdefault((entry.check.advice, entry.check.passed, entry.filters), []).append(entry)
    return [Advice(tuple(group), text) for (text, _, _), group in alike.items()]


def counts_in_words(checks: Sequence[Check]) -> list[str]:
    """Return how many checks passed; estimates with equal counts share a sentence."""
    labels: dict[str, list[str]] = {}
    for name in dict.fromkeys(check.filter for check in checks):
        verdicts = [check.passed for check in checks if check.filter == name]
        counts = Counter(verdicts)
        others = "".join(f", {counts[passed]} {word}" for passed, word in _COUNTED.items() if counts[passed])
        labels.setdefault(f"{counts[True]} of {len(verdicts)} passed{others}", []).append(name)
    return [f"{whose(names)}: {counted}" for counted, names in labels.items()]


def whose(filters: Collection[str], among: Collection[str] = ()) -> str:
    """Return the names of estimators, "all" if they are all of several, or "data" without an estimator."""
    if len(filters) == len(among) > 1:
        return "all"
    return ", ".join(filter_label(name) if name else "data" for name in filters)


def joined_words(words: Sequence[str]) -> str:
    """Write words as a sentence lists them: ``a, b and c``."""
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def fit_sentences(fit: Fit) -> list[str]:
    """Return what a search found, a sentence each."""
    lines = [fit.trial] if fit.trial else []
    lines.append(f"Judgement: {fit.judgement}.")
    lines.append(f"Added to the model: {', '.join(fit.added) if fit.added else 'nothing'}.")
    lines += [f"{step.what}: {step.size}." for step in fit.steps if step.kept and step.size]
    if held := ", ".join(held_motions(fit)):
        lines.append(f"Held at the vehicle file's values, because these data hardly have such motion: {held}.")
    zeros = [str(step.what) for step in fit.steps if step.action == "leave at 0" and step.kept]
    lines += [f"Left at 0, as in the vehicle file, because these data do not need them: {zero}." for zero in zeros]
    if fit.stopped:
        lines.append(f"The search ended early: {fit.stopped}. This is the best model so far.")
    return lines


def unexplained_sentences(fit: Fit) -> list[str]:
    """Return a sentence for each fault that the tests of the model still find."""
    return [f"Unexplained: {cause}." for cause in fit.unexplained]


def held_motions(fit: Fit) -> list[str]:
    """Return the motions whose coefficients were held."""
    return [str(step.what).removeprefix(_COEFFICIENTS_OF) for step in fit.steps if step.action == "hold"]


def measure_next_time(fit: Fit) -> Iterator[str]:
    """Yield advice for the next run, one sentence for each unknown of these data."""
    for motion in held_motions(fit):
        yield f"For {motion}: {_EXCITATION[motion]}."
    if not fit.estimate.completed:
        return
    rows = coefficient_results(fit.estimate, None, {}, fit.judgement)
    if fit.is_sound and (weak := [row.coefficient for row in rows if not row.identified]):
        yield f"For {', '.join(weak)}, which are not identified: `auvid design --at ESTIMATE` finds a better manoeuvre."
    if "gyroscope" not in fit.estimate.innovations:
        yield "Record a gyroscope: without one, the yaw rate is known from the heading only."
    if any(step.key == (BiasName.THRUST, "") for step in fit.steps if step.kept):
        yield "Record the thrust, or measure it at known revolutions: drag and thrust are only known together."


def steps_tables(fit: Fit) -> list[Table]:
    """Return a table of the steps that made the model, and one of what was tried and not kept, if any."""
    kept, rest = ([step for step in fit.steps if step.kept is is_kept] for is_kept in (True, False))
    cells: dict[Column, Callable[[FitStep], Cell]] = {
        Column("look"): lambda step: step.look,
        text_column("step"): lambda step: step.action,
        text_column("what"): lambda step: str(step.what),
        text_column("size ± standard deviation"): lambda step: step.size or None,
        Column("gain in evidence"): lambda step: None if step.gain is None else f"{step.gain:+.1f}",
        text_column("judged before"): lambda step: step.judged_before or None,
        text_column("judged after"): lambda step: step.judged_after or None,
        Column("processor time in s"): lambda step: f"{step.cpu_time:.1f}",
    }
    tables = [tabulated("fit_steps", "Steps", kept, cells)]
    if rest:
        tried = tabulated("fit_tried", "Tried and not kept", rest, cells)
        tables.append(tried.without("size ± standard deviation", "judged after"))
    return tables
