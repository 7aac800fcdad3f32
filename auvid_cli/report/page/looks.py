"""Style sheet of the filters' lines, and the shapes of their marks."""

from auvid_cli.report.lines import FILTER_LINES

_CIRCLE = "o"


def filter_styles() -> str:
    """Return a style sheet with colour, width and dashes of each filter."""
    light, dark, rules = list[str](), list[str](), list[str]()
    for name, line in FILTER_LINES.items():
        dash = " ".join(f"{line.width * length:.3g}" for length in line.dash)
        light += [f"--{name}: {line.color};", f"--{name}-width: {line.width:g};"]
        light += [f"--{name}-dash: {dash};"] if dash else []
        dark.append(f"--{name}: {line.color_on_dark};")
        rules.append(f".{name} {{ color: var(--{name}); }}")
        lengths = dash or "none"
        rules.append(f".drawing polyline.{name} {{ stroke-width: {line.width:g}; stroke-dasharray: {lengths}; }}")
    return "\n".join(
        [
            f":root {{ {' '.join(light)} }}",
            f"@media (prefers-color-scheme: dark) {{ :root:not(.paper) {{ {' '.join(dark)} }} }}",
            *rules,
        ]
    )


def marker(look: str) -> str:
    """Return the marker of a filter, or a circle for every other look."""
    return FILTER_LINES[look].marker if look in FILTER_LINES else _CIRCLE
