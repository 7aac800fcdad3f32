"""How symbols and units look in print."""

import re
from collections.abc import Sequence

from auvid_cli.vehicle.coefficients import COEFFICIENTS, is_name_of_term

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_FINS = {"rudder": r"\delta_r", "elevator": r"\delta_e"}
_WORDS = {"heading": r"$\psi$", "down": "depth"}
_GREEK = ("phi", "theta", "psi")
# Letters of a subscript that is no word.
_SHORT = 2
_DVL = {"dvl_scale": r"$s_{\mathrm{DVL}}$", "dvl_yaw": r"$\psi_{\mathrm{DVL}}$"}
# Coefficients that one picture has room for.
_MANY = 14
_COEFFICIENTS = {c.symbol: c for c in COEFFICIENTS}


def symbol_math(symbol: str) -> str:
    r"""Write a symbol as mathematics for LaTeX and mathtext, for example ``$X_{u|u|}$`` or ``$\psi$``."""
    if symbol in _WORDS:
        return _WORDS[symbol]
    if symbol in _GREEK:
        return rf"$\{symbol}$"
    if symbol in _COEFFICIENTS:
        letter, subscript = symbol.split("_", 1)
        coefficient = _COEFFICIENTS[symbol]
        if coefficient.group == "control":
            subscript = "".join(_FINS.get(signal, signal) for signal in coefficient.signals)
        return f"${letter}_{{{subscript}}}$"
    if symbol in _DVL:
        return _DVL[symbol]
    if is_name_of_term(symbol):
        letter, subscript = symbol.split("_", 1)
        return f"${letter}_{{{subscript.replace('_', ',')}}}$"
    if "_" in symbol:
        # Of an error: a bias of a quantity, a current towards somewhere.
        word, of = symbol.split("_", 1)
        subscript = rf"\{of}" if of in _GREEK else of if len(of) <= _SHORT else rf"\mathrm{{{of}}}"
        return f"${word[0]}_{{{subscript}}}$"
    letter, subscript = symbol[0], symbol[1:]
    return f"${letter}_{{{subscript}}}$" if subscript else f"${letter}$"


def unit_text(unit: str) -> str:
    """Write a unit in Unicode, for example ``kg·m²/rad²``."""
    raised = re.sub(r"\^(-?\d+)(?!\.)", lambda power: power[1].translate(_SUPERSCRIPTS), unit)
    return raised.replace("*", "·")


def unit_latex(unit: str) -> str:
    r"""Write a unit in LaTeX, for example ``kg\,m$^{2}$/rad$^{2}$``."""
    return re.sub(r"\^(-?\d+)", r"$^{\1}$", unit).replace("*", r"\,")


def by_kind(symbols: Sequence[str]) -> dict[str, list[str]]:
    """Put coefficients that are many for one picture in two groups, those of forces and those of moments.

    Returns
    -------
    dict
        Symbols by what they are, in the order in which they came; all by ``""`` where they are few.
    """
    if len(symbols) <= _MANY:
        return {"": list(symbols)}
    groups = {"forces": [s for s in symbols if s[0] in "XYZ"], "moments": [s for s in symbols if s[0] not in "XYZ"]}
    return {kind: group for kind, group in groups.items() if group}


def filter_label(name: str) -> str:
    """Write a filter's name as it is read: EKF and so on; OE for the output-error method, the smoother in full."""
    return {"output_error": "OE", "smoother": "smoother"}.get(name, name.upper())


def setting_text(value: object) -> str:
    """Write a value of an axis of a campaign."""
    return f"{value:g}" if isinstance(value, float) else str(value)
