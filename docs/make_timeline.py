"""Draw events and the smoother's two passes into docs/images/timeline.svg: `python docs/make_timeline.py`."""

from pathlib import Path

TARGET = Path(__file__).parent / "images/timeline.svg"
_LEFT, _RIGHT = 170, 850
# Samples in pixels from the left end of the axis.
_SAMPLES = {
    "gyroscope": range(20, 670, 50),
    "DVL": (45, 220, 395, 570),
    "attitude": range(70, 670, 100),
    "inputs": (0, 145, 290, 435, 580),
}
_COLOURS = {"gyroscope": "#0b5fa5", "DVL": "#b3261e", "attitude": "#2e7d32", "inputs": "#555"}


def _text(x: float, y: float, words: str, colour: str = "#222") -> str:
    return f'<text x="{x}" y="{y}" fill="{colour}">{words}</text>'


def _line(x1: float, y1: float, x2: float, y2: float, style: str) -> str:
    return f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" {style}/>'


def timeline() -> str:
    """Return the picture: samples by sensor, all events on one axis, and the two passes of the smoother."""
    parts = []
    for row, (name, places) in enumerate(_SAMPLES.items()):
        y, colour = 30 + 26 * row, _COLOURS[name]
        parts += [_text(20, y + 5, name, colour), _line(_LEFT, y, _RIGHT, y, 'stroke="#ccc"')]
        for place in places:
            x = _LEFT + place
            parts.append(_line(x, y, x, 150, f'stroke="{colour}" stroke-opacity=".3"'))
            if name == "inputs":
                parts.append(f'<rect x="{x - 4}" y="{y - 4}" width="8" height="8" fill="{colour}"/>')
            else:
                parts.append(f'<circle cx="{x}" cy="{y}" r="5" fill="{colour}"/>')
            parts.append(_line(x, 143, x, 157, f'stroke="{colour}" stroke-width="3"'))
    arrow = 'stroke="#222" stroke-width="2" marker-end="url(#head)"'
    parts += [
        _text(20, 155, "events"),
        _line(_LEFT, 150, _RIGHT + 20, 150, arrow),
        _text(_RIGHT - 10, 172, "time"),
        _text(20, 205, "forward pass"),
        _line(_LEFT, 200, _RIGHT + 20, 200, arrow),
        _text(_LEFT + 130, 220, "filter: F, innovation e, variance S, gain; sum of NIS"),
        _text(20, 250, "backward pass"),
        _line(_RIGHT + 20, 245, _LEFT, 245, arrow),
        _text(_LEFT + 130, 265, "adjoint r: what later measurements say; step = deviation + P r"),
    ]
    head = (
        '<marker id="head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 0 L10 5 L0 10z" fill="#222"/></marker>'
    )
    body = "\n".join(parts)
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 900 280" font-family="sans-serif" font-size="14">\n'
        f'<rect width="900" height="280" fill="#fff"/>\n<defs>{head}</defs>\n{body}\n</svg>\n'
    )


if __name__ == "__main__":
    TARGET.write_text(timeline(), encoding="utf-8")
