"""Equations of the pages as MathML, which browsers draw by themselves: made while the site is built, without a script.

Written as GitHub reads them: LaTeX in a fence called ``math``, or within a line between a dollar sign with a backtick
and a backtick with a dollar sign. What is no LaTeX ends the build.
"""

from typing import Any

from markdown import Extension, Markdown
from markdown.inlinepatterns import InlineProcessor
from math_core import LatexError, LatexToMathML
from pymdownx.superfences import SuperFencesException

_INLINE = r"\$`([^`]+)`\$"
# Before code between backticks, which has 190.
_PRIORITY = 195


def mathml(latex: str, *, block: bool) -> str:
    """Return an equation as MathML.

    Raises
    ------
    SuperFencesException
        What cannot be read; of any other exception a fence would become code.
    """
    try:
        return LatexToMathML(fancy_error=False).convert_with_local_state(latex, displaystyle=block)
    except LatexError as error:
        raise SuperFencesException(f"{latex.strip()}: {error}") from error


def fence(source: str, *_: Any, **__: Any) -> str:
    """Return what stands for a fence, as ``pymdownx.superfences`` asks for it."""
    return f'<div class="equation" tabindex="0">{mathml(source, block=True)}</div>'


class _Inline(InlineProcessor):
    def handleMatch(self, m: Any, data: str) -> tuple[str, int, int]:
        return self.md.htmlStash.store(mathml(m[1], block=False)), m.start(0), m.end(0)


class EquationExtension(Extension):
    """Equations within a line."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Read them before code."""
        md.inlinePatterns.register(_Inline(_INLINE, md), "equation", _PRIORITY)


def makeExtension(**settings: Any) -> EquationExtension:
    """Return the extension, for `mkdocs.yml`."""
    return EquationExtension(**settings)
