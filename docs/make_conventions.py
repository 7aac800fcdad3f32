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


def _tail(x: float, y: float, deflection: float) -> str:
    """Return hull and four fins from behind; `deflection` moves the trailing edges, in pixels."""
    parts = [f'<circle cx="{x}" cy="{y}" r="36" fill="#e8eef4" stroke="{_GREY}"/>']
    for side in (-1, 1):
        root, tip = 36 * side, 82 * side
        edges = (
            [(0, root), (0, tip), (-deflection, tip), (-deflection, root)],
            [(root, 0), (tip, 0), (tip, deflection), (root, deflection)],
        )
        for edge in edges:
            points = " ".join(f"{x + right},{y + down}" for right, down in edge)
            colour = _RED if deflection else _GREY
            parts.append(f'<polygon points="{points}" fill="{colour}" fill-opacity=".25" stroke="{colour}"/>')
    return "".join(parts)


def conventions() -> str:
    """Return the picture: from above and from the side with positive fins, and from behind without and with roll."""
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
        _arrow(225, 110, 405, 110),
        _text(345, 100, "x, u, X: forward", _BLUE),
        _arrow(225, 110, 225, 190),
        _text(216, 207, "y, v, Y: starboard", _BLUE),
        _arrow(225, 110, 385, 168),
        _text(392, 176, "course", _BLUE),
        _arc("M352 112 A127 127 0 0 1 346 151"),
        _text(359, 136, "beta", _BLUE),
        _arc("M300 60 A70 70 0 0 1 345 86"),
        _text(255, 52, "r, psi, N: bow to starboard", _BLUE),
        _arrow(95, 120, 95, 175, _RED),
        _text(20, 195, "rudder &gt; 0: tail to", _RED),
        _text(20, 211, "starboard (Y &gt; 0),", _RED),
        _text(20, 227, "bow to port (N &lt; 0)", _RED),
    ]
    aside = [
        _text(540, 26, "From the port side (bow to the left)", weight="bold"),
        f'<g transform="translate(1080 0) scale(-1 1)">{_hull(290, 110)}</g>',
        f'<line x1="788" y1="110" x2="822" y2="128" stroke="{_RED}" stroke-width="5"/>',
        _arrow(675, 110, 535, 110),
        _text(520, 130, "x, u, X", _BLUE),
        _arrow(675, 110, 675, 190),
        _text(640, 207, "z, w, Z, depth: down", _BLUE),
        _arc("M570 134 A70 70 0 0 1 560 76"),
        _text(520, 62, "q, theta, M: bow up", _BLUE),
        _arrow(805, 104, 805, 50, _RED),
        _text(718, 155, "elevator &gt; 0: tail up", _RED),
        _text(718, 171, "(Z &lt; 0), bow down (M &lt; 0)", _RED),
    ]
    behind = [
        _text(20, 270, "From behind (bow away from you)", weight="bold"),
        _tail(230, 390, 14),
        _arrow(320, 390, 385, 390),
        _text(350, 380, "y, v, Y: starboard", _BLUE),
        _arrow(230, 478, 230, 520),
        _text(240, 518, "z, w, Z: down", _BLUE),
        _arc("M142 344 A100 100 0 0 1 318 344"),
        _text(270, 300, "p, phi, K: starboard side down", _BLUE),
        _arrow(238, 335, 288, 335, _RED),
        _text(20, 310, "rudder &gt; 0: trailing", _RED),
        _text(20, 326, "edges to port", _RED),
        _arrow(172, 384, 172, 356, _RED),
        _text(60, 430, "elevator &gt; 0:", _RED),
        _text(60, 446, "trailing edges down", _RED),
    ]
    rolled = [
        _text(540, 270, "From behind, with roll phi &gt; 0", weight="bold"),
        f'<line x1="550" y1="390" x2="850" y2="390" stroke="{_GREY}" stroke-dasharray="6 4"/>',
        _text(550, 382, "horizontal", _GREY),
        f'<g transform="rotate(25 690 390)">{_tail(690, 390, 0)}{_arrow(780, 390, 845, 390)}</g>',
        _text(838, 466, "y", _BLUE),
        _arc("M825 392 A135 135 0 0 1 814 443"),
        _text(828, 418, "phi", _BLUE),
        _text(640, 518, "starboard fin is lower", _BLUE),
    ]
    body = "\n".join(above + aside + behind + rolled)
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 900 535" font-family="sans-serif" font-size="14">\n'
        f'<rect width="900" height="535" fill="#fff"/>\n<defs>{heads}</defs>\n{body}\n</svg>\n'
    )


if __name__ == "__main__":
    TARGET.write_text(conventions(), encoding="utf-8")
