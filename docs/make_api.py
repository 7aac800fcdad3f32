"""Write docs/api.md from the docstrings of the public names of `auvid_cli`: `python docs/make_api.py`."""

import inspect
import re
import textwrap
from pathlib import Path

import auvid_cli

TARGET = Path(__file__).with_name("api.md")
OPENING = """# Python API

You want to use auvid from Python. Here is each function with its parameters, results and an example. The
[tutorial](tutorial.md) uses the main ones. `python docs/make_api.py` makes this page from the docstrings; do not edit.

    import auvid_cli as auvid

The import is fast, because each name is loaded when it is first used. Functions print nothing, and write a file only if
they get its name. Paths are text or `pathlib.Path`; filters and formats are named by text. Numbers are SI, angles
radians. Mistakes in settings, files or data raise an `auvid_cli.errors.AuvidError`. An argument of a wrong type raises
a `TypeError`.

`to_pandas()` makes a table of a result, or several tables by name, with the names and columns of the CSV files that the
commands write. `to_xarray()` makes labelled arrays over time with units and the names of the data files; it needs
xarray: run `pip install '.[xarray]'` in the clone.

"""
SECTION = re.compile(r"^(\w+)\n-+\n", re.MULTILINE)
RESULTS = (auvid_cli.Dataset, auvid_cli.Estimate)


def api() -> str:
    """Return the whole page."""
    functions = [getattr(auvid_cli, name) for name in auvid_cli.__all__ if getattr(auvid_cli, name) not in RESULTS]
    page = OPENING + "".join(described(each, each.__name__) for each in functions)
    for result in RESULTS:
        page += described(result, result.__name__, with_signature=False)
        page += "".join(described(method, f"{result.__name__}.{name}") for name, method in methods(result))
    return page.rstrip() + "\n"


def methods(kind: type):
    """Return the public methods that a class itself defines, by name."""
    return [(name, each) for name, each in vars(kind).items() if inspect.isfunction(each) and not name.startswith("_")]


def described(thing, name: str, *, with_signature: bool = True) -> str:
    """Return a heading, the signature, and the sections of a docstring."""
    opening, *sections = SECTION.split(inspect.getdoc(thing) or "")
    text = f"## `{name}`\n\n" + (f"```python\n{signature(thing, name)}\n```\n\n" if with_signature else "")
    text += opening.strip() + "\n\n"
    for title, body in zip(sections[::2], sections[1::2], strict=True):
        text += f"```python\n{body.strip()}\n```\n\n" if title == "Examples" else f"{title}:\n\n{entries(body)}\n"
    return text


def entries(body: str) -> str:
    """Return the entries of a section as a Markdown list."""
    found = re.findall(r"^(\S.*)\n((?:[ ]+.*\n?)*)", body.strip() + "\n", re.MULTILINE)
    return "".join(f"- `{what}`" + (f": {flat(said)}" if said.strip() else "") + "\n" for what, said in found)


def flat(text: str) -> str:
    """Return indented lines as one, with code as Markdown has it."""
    return " ".join(textwrap.dedent(text).split()).replace("``", "`")


def signature(thing, name: str) -> str:
    """Return a call with the types of what it takes and gives, without the modules where they are."""
    text = re.sub(r"[\w.]*\.(?=\w)", "", str(inspect.signature(thing))).replace("'", "")
    return f"{name}{text.replace('(self, ', '(').replace('(self)', '()')}"


if __name__ == "__main__":
    TARGET.write_text(api(), encoding="utf-8")
