"""The page of recorded data, judged before anybody identifies from them."""

from collections import defaultdict

from auvid_cli.data.dataset import Dataset
from auvid_cli.inspection.inspection import Inspection
from auvid_cli.report.page.course import HOW_TO_LOOK, input_plots, sensor_plots
from auvid_cli.report.page.parts import Card, Cards, Page, Part, Plots, Section, Words
from auvid_cli.report.page.provenance import provenance_section
from auvid_cli.report.page.verdicts import check_parts


def inspection_page(dataset: Dataset, inspection: Inspection) -> Page:
    """Lay out the verdicts on data, and the data themselves, shaded where something is the matter."""
    begin, end = inspection.span
    sections = (
        Section("verdict", "Verdict", [_verdict(inspection)]),
        Section("checks", "Checks", check_parts(inspection.checks)),
        Section("course", "What was recorded", _recorded(dataset, inspection)),
        provenance_section(dataset),
    )
    subtitle = f"{dataset.experiment.vehicle.name}, {begin:.6g} to {end:.6g} s, sensors {', '.join(dataset.sensors)}"
    return Page(f"Inspection: {dataset.experiment.name}", subtitle, sections)


def _verdict(inspection: Inspection) -> Cards:
    failed = inspection.checks.failed()
    noted = sum(check.passed is None for check in inspection.checks)
    says = "Nothing fails: identify from these data"
    says += f", and read the {noted} note{'s' * (noted > 1)} below." if noted else "."
    if failed:
        names = ", ".join(f"{check.check} of {check.subject}" for check in failed)
        says = f"Mend these first, or leave bad times out with --use BEGIN:END: {names}."
    counts = {"failed": str(len(failed)), "worth knowing": str(noted), "checks": str(len(inspection.checks))}
    return Cards([Card("These data", "input", "fails" if failed else "passes", says, counts)])


def _recorded(dataset: Dataset, inspection: Inspection) -> list[Part]:
    marks: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for mark in inspection.marks:
        marks[mark.sensor].append((mark.start, mark.end))
    words = f"{HOW_TO_LOOK} Shaded: spikes, jumps, stuck values, gaps and clocks that jump."
    plots = [*input_plots(dataset.inputs), *sensor_plots(dataset.sensors, {}, marks)]
    return [Words([words]), Plots(plots, linked="time", wide=True)]
