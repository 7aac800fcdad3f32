"""From outcomes to the table and the list of failures."""

import re
from collections import defaultdict
from collections.abc import Sequence

from benchmarks.attack.kinds import KINDS
from benchmarks.attack.outcome import COLUMNS, Outcome


def markdown(outcomes: Sequence[Outcome], seed: int, limit: float) -> str:
    """Write how many cases of each kind there were, and how many failed in which way."""
    lines = [
        f"Seed {seed}. A command hangs if it does not end within {limit:g} s; a command that still works then is sent "
        "Ctrl-C.",
        "",
        f"| cases | number | {' | '.join(COLUMNS.values())} |",
        f"| --- {'| ---: ' * (1 + len(COLUMNS))}|",
    ]
    rows = [(kind.title, [each for each in outcomes if each.kind == name]) for name, kind in KINDS.items()]
    rows.append(("all", list(outcomes)))
    for title, of in ((title, of) for title, of in rows if of):
        counts = [sum(column in each.faults for each in of) for column in COLUMNS]
        lines.append(f"| {title} | {len(of)} | {' | '.join(map(str, counts))} |")
    return "\n".join(lines) + "\n"


def groups(outcomes: Sequence[Outcome]) -> dict[tuple[str, str, str], list[Outcome]]:
    """Group failures that look alike: of one kind, in one column, with the same words but for numbers and names."""
    found: dict[tuple[str, str, str], list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        for column, text in outcome.faults.items():
            found[outcome.kind, column, alike(text)].append(outcome)
    return dict(sorted(found.items(), key=lambda item: (item[0][:2], -len(item[1]))))


def alike(text: str) -> str:
    """Return a failure without what differs from case to case; lines of the program stay."""
    text = re.sub(r"^(again: )?[a-z]+: ", "", text)
    place = text.rpartition(" at auvid_cli/")
    said, rest = (place[0], " at auvid_cli/" + place[2]) if place[1] else (text, "")
    return re.sub(r"0x[0-9a-f]+|'[^']*'|\"[^\"]*\"|[-+\d.]*\d\S*", "~", said)[:140] + rest


def failures(outcomes: Sequence[Outcome], repeat: str) -> str:
    """List each group of failures with its number of cases, one of them, and the command that repeats it."""
    lines = []
    for (kind, column, text), members in groups(outcomes).items():
        first = members[0]
        lines += [
            f"{len(members)} x {kind}, {COLUMNS[column]}: {text}",
            f"    {first.faults[column][:300]}",
            f"    {first.what[:200]}",
            f"    {repeat} --only {kind}:{first.index}",
            "",
        ]
    return "\n".join(lines)
