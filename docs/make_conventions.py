"""Draw the signs of axes, angles and fins into docs/images/conventions.svg: `python docs/make_conventions.py`."""

from pathlib import Path

TARGET = Path(__file__).parent / "images/conventions.svg"
_BLUE, _RED, _GREY = "#0b5fa5", "#b3261e", "#555"


def _arrow(x1: float, y1: float, x2: float, y2: float, colour: str = _BLUE) -> str:
    return (
        f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke="{colour}" stroke-width="2" '
        f'marker-end="url(#{colour[1:]})"/>'
    )


def _arc(path: str, colour: str = _BLUE) -> str:
    return f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="2" marker-end="url(#{colour[1:]})"/>'


def _text(x: float, y: float, words: str, colour: str = "#222", weight: str = "normal") -> str:
    return f'<text x="{x}" y="{y}" fill="{colour}" font-weight="{weight}">{words}</text>'


def _hull(x: float, y: float) -> str:
    return (
        f'<path d="M{x} {y} q8 -16 40 -16 h120 q40 0 50 16 q-10 16 -50 16 h-120 q-32 0 -40 -16z" '
        f'fill="#e8eef4" stroke="{_GREY}"/>'
    )


def conventions() -> str:
    """Return the picture: from above with a positive rudder, and from the port side with a positive elevator."""
    heads = "".join(
        f'<marker id="{colour[1:]}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" '
        f'markerHeight="7" orient="auto">'
        f'<path d="M0 0 L10 5 L0 10z" fill="{colour}"/></marker>'
        for colour in (_BLUE, _RED)
    )
    above = [
        _text(20, 26, "From above (bow to the right)", weight="bold"),
        _hull(110, 110),
        f'<line x1="112" y1="110" x2="78" y2="92" stroke="{_RED}" stroke-width="5"/>',
        _arrow(225, 110, 385, 110),
        _text(350, 100, "x, u: forward", _BLUE),
        _arrow(225, 110, 225, 190),
        _text(232, 190, "y, v: starboard", _BLUE),
        _arc("M300 60 A70 70 0 0 1 345 86"),
        _text(270, 52, "r, psi: bow to starboard", _BLUE),
        _arrow(95, 120, 95, 175, _RED),
        _text(20, 195, "rudder &gt; 0: force to starboard", _RED),
        _arrow(310, 128, 310, 78, _RED),
        _text(328, 150, "bow turns to port (N &lt; 0)", _RED),
    ]
    aside = [
        _text(540, 26, "From the port side (bow to the left)", weight="bold"),
        f'<g transform="translate(1080 0) scale(-1 1)">{_hull(290, 110)}</g>',
        f'<line x1="788" y1="110" x2="822" y2="128" stroke="{_RED}" stroke-width="5"/>',
        _arrow(675, 110, 535, 110),
        _text(520, 100, "x, u", _BLUE),
        _arrow(675, 110, 675, 190),
        _text(682, 190, "z, w, depth: down", _BLUE),
        _arc("M570 134 A70 70 0 0 1 560 76"),
        _text(520, 62, "q, theta: bow up", _BLUE),
        _arrow(805, 104, 805, 50, _RED),
        _text(700, 44, "elevator &gt; 0: tail up", _RED),
        _arrow(600, 128, 600, 166, _RED),
        _text(500, 182, "bow goes down (M &lt; 0)", _RED),
    ]
    body = "\n".join(above + aside)
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 900 215" font-family="sans-serif" font-size="14">\n'
        f'<rect width="900" height="215" fill="#fff"/>\n<defs>{heads}</defs>\n{body}\n</svg>\n'
    )


if __name__ == "__main__":
    TARGET.write_text(conventions(), encoding="utf-8")
