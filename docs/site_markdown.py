"""Extension of Python-Markdown, so that the site shows the same as GitHub.

Equations are LaTeX in a fence called ``math``, or within a line between a dollar sign with a backtick and a backtick
with a dollar sign. They become MathML while the site is built, which browsers draw by themselves, without a script.
Invalid LaTeX ends the build. In tables, the backslash before a bar in code is removed.
"""

import re
from typing import Any

from markdown import Extension, Markdown
from markdown.inlinepatterns import InlineProcessor
from markdown.preprocessors import Preprocessor
from math_core import LatexError, LatexToMathML
from pymdownx.superfences import SuperFencesException

_EQUATION = r"\$`([^`]+)`\$"
# Before code between backticks, which has 190; after fences, which have 25.
_INLINE_PRIORITY, _TABLE_PRIORITY = 195, 20


def mathml(latex: str, *, block: bool) -> str:
    """Return an equation as MathML.

    Raises
    ------
    SuperFencesException
        If the equation is invalid. After any other exception the fence would become code.
    """
    try:
        return LatexToMathML(fancy_error=False).convert_with_local_state(latex, displaystyle=block)
    except LatexError as error:
        raise SuperFencesException(f"{latex.strip()}: {error}") from error


def fence(source: str, *_: Any, **__: Any) -> str:
    """Return the HTML of a fence, for ``pymdownx.superfences``."""
    return f'<div class="equation" tabindex="0">{mathml(source, block=True)}</div>'


class _Equation(InlineProcessor):
    def handleMatch(self, m: Any, data: str) -> tuple[str, int, int]:
        return self.md.htmlStash.store(mathml(m[1], block=False)), m.start(0), m.end(0)


class _BarsInTables(Preprocessor):
    def run(self, lines: list[str]) -> list[str]:
        def bare(code: re.Match[str]) -> str:
            return code[0].replace("\\|", "|")

        return [re.sub("`[^`]+`", bare, line) if line.startswith("|") else line for line in lines]


class AsGitHub(Extension):
    """Equations within a line, and bars within tables."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Add both to a Markdown parser."""
        md.inlinePatterns.register(_Equation(_EQUATION, md), "equation", _INLINE_PRIORITY)
        md.preprocessors.register(_BarsInTables(md), "bars in tables", _TABLE_PRIORITY)


def makeExtension(**settings: Any) -> AsGitHub:
    """Return the extension, for `mkdocs.yml`."""
    return AsGitHub(**settings)
