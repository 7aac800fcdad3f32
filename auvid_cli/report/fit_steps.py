"""Sentences and tables on a search for a model."""

from collections.abc import Callable, Iterator

from auvid_cli.evaluation.accuracy import coefficient_results
from auvid_cli.fitting.results import Fit, FitStep
from auvid_cli.report.table import Cell, Column, Table, tabulated, text_column

# Excitation of each motion whose coefficients can be held.
_EXCITATION = {
    "the vertical plane": "dive and climb with clear movements of the elevator",
    "the horizontal plane": "turn to both sides with clear movements of the rudder",
    "roll": "change the roll moment, and record the roll rate",
}
_HELD = "coefficients of "


def fit_sentences(fit: Fit) -> list[str]:
    """Return what a search found, a sentence each."""
    lines = [fit.trial] if fit.trial else []
    lines.append(f"Judgement: {fit.judgement}.")
    lines.append(f"Added to the model: {', '.join(fit.added) if fit.added else 'nothing'}.")
    lines += [f"{step.what}: {step.size}." for step in fit.steps if step.kept and step.size]
    if held := ", ".join(held_motions(fit)):
        lines.append(f"Held at the vehicle file's values, because these data hardly have such motion: {held}.")
    lines += [f"Unexplained: {cause}." for cause in fit.unexplained]
    if fit.stopped:
        lines.append(f"The search ended early: {fit.stopped}. This is the best model so far.")
    return lines


def held_motions(fit: Fit) -> list[str]:
    """Return the motions whose coefficients were held."""
    return [step.what.removeprefix(_HELD) for step in fit.steps if step.action == "hold"]


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
    if any(step.what == "scale of the thrust" for step in fit.steps if step.kept):
        yield "Record the thrust, or measure it at known revolutions: drag and thrust are only known together."


def steps_tables(fit: Fit) -> list[Table]:
    """Return a table of the steps that made the model, and one of what was tried and not kept, if any."""
    kept, rest = ([step for step in fit.steps if step.kept is is_kept] for is_kept in (True, False))
    cells: dict[Column, Callable[[FitStep], Cell]] = {
        Column("look"): lambda step: step.look,
        text_column("step"): lambda step: step.action,
        text_column("what"): lambda step: step.what,
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
