import importlib.util
import math
import re
from pathlib import Path

import pytest
import yaml
from pydantic import BaseModel, ValidationError

from auvid_cli.config.loading import find_experiment, load_experiment
from docs import make_conventions, make_geometry, make_reference, make_rows, make_timeline
from docs.make_architecture import TARGET, architecture
from docs.make_conventions import conventions
from docs.make_timeline import timeline

ROOT = Path(__file__).parents[1]
# Of a positive rudder and elevator in docs/images/conventions.svg.
FIN_SIGNS = {"Y_uudr": 1, "N_uudr": -1, "Z_uude": -1, "M_uude": -1}


@pytest.mark.parametrize("name", ["reference", "api"])
def test_a_page_is_what_the_package_says(name):
    spec = importlib.util.spec_from_file_location(f"make_{name}", ROOT / f"docs/make_{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert (ROOT / f"docs/{name}.md").read_text(encoding="utf-8") == getattr(module, name)(), (
        f"docs/{name}.md is out of date: python docs/make_{name}.py"
    )


# Other keys that a key may need, such as a column for its unit.
NEEDED_TOO: tuple[dict[str, object], ...] = (
    {},
    {"column": "x"},
    {"columns": ["x", "y", "z"]},
    {"noise": 0.1},
    {"mean": "vehicle"},
    {"rudder": {"column": "x"}},
    {"revolutions": {"column": "x"}, "a": 1},
    {"share": {"column": "x"}, "full": 1},
    {"depth": {"rate": 1, "noise": 1}},
)


def errors_of(model: type[BaseModel], key: str, tree: dict[str, object]) -> list[str]:
    """Return the errors of a key, and those of the section that are not missing keys."""
    try:
        model.model_validate(tree)
    except ValidationError as error:
        return [e["msg"] for e in error.errors() if e["type"] != "missing" and e["loc"][:1] in ((), (key,))]
    return []


@pytest.mark.slow
def test_each_key_of_the_reference_has_a_meaning_and_a_valid_example():
    checked = 0
    for model, path in make_reference.all_sections().items():
        kind = make_reference.type_of(model)
        for name, field in model.model_fields.items():
            key, where = field.alias or name, f"{path}.{field.alias or name}"
            if name == "type":
                continue
            assert make_reference.meaning(field), where
            text = make_reference.example(path, kind, model, name, field).strip("`")
            if make_reference.classes(field.annotation):
                continue  # a section of its own
            own: dict[str, object] = {key: yaml.safe_load(text)}
            if kind:
                own["type"] = kind
            errors = [errors_of(model, key, needed | own) for needed in NEEDED_TOO]
            assert text, where
            assert [] in errors, f"{where}: {text}: {errors[0]}"
            checked += 1
    assert checked > 500


def test_the_table_of_shapes_is_what_the_formulas_give():
    theory = (ROOT / "docs/theory.md").read_text(encoding="utf-8")
    assert make_geometry.table() in theory, "python -m docs.make_geometry"


@pytest.mark.slow
def test_the_picture_of_the_rooms_is_what_the_code_imports():
    assert architecture() == TARGET.read_text(encoding="utf-8"), "python docs/make_architecture.py"


def test_files_in_the_tables_of_the_architecture_exist():
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    paths = re.findall(r"`((?:[a-z_]+/)+(?:[\w.]+\.[a-z0-9]+)?)`", text.partition("## How to add")[2])
    assert len(paths) > 50
    missing = [path for path in paths if not any((ROOT / folder / path).exists() for folder in ("", "auvid_cli"))]
    assert missing == []
    tests = {path.name for path in (ROOT / "tests").rglob("test_*.py")}
    assert {*re.findall(r"`(test_\w+\.py)`", text)} <= tests


def anchors(page: Path) -> set[str]:
    """Anchors of the headings of a page, as GitHub and the site make them."""
    titles = re.findall(r"(?m)^#{1,6} (.*)", re.sub(r"(?ms)^```.*?^```", "", page.read_text(encoding="utf-8")))
    return {re.sub(r"\s", "-", re.sub(r"[^\w\- ]", "", title.lower())) for title in titles}


def test_links_of_the_documents_lead_somewhere():
    for page in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")):
        for path, anchor in re.findall(r"\]\(([^)#\s]*)#?([^)\s]*)\)", page.read_text(encoding="utf-8")):
            if not path.startswith("http"):
                target = page.parent / path if path else page
                assert target.exists(), f"{page.name} links to {path}"
                is_heading = anchor and target.suffix == ".md"  # of a picture, its colour scheme
                assert not is_heading or anchor in anchors(target), f"{page.name} links to {path}#{anchor}"


def numbers(text: str) -> set[str]:
    return set(re.findall(r"(?<![\w.,])-?\d+(?:\.\d+)?", re.sub(r"(?<=\d),(?=\d{3})", "", text)))


def test_studies_begin_with_an_answer_and_a_small_table_of_measured_numbers():
    """The numbers of the small table are in the folded part, which a command writes."""
    studies = (ROOT / "docs/studies.md").read_text(encoding="utf-8")
    for section in studies.split("\n## ")[1:]:
        title, (beginning, _, details) = section.partition("\n")[0], section.partition("<details")
        parts = re.findall(r"(?m)^\*\*(\w+)\.\*\* ", beginning)
        assert parts == ["Question", "Answer", "Size"], title
        rows = re.findall(r"(?m)^\|.*", beginning)[2:]
        assert 2 <= len(rows) <= 6 or title == "What `auvid fit` finds", f"{title}: {len(rows)} rows"
        for row in rows:
            first, *cells = row.strip("|").split("|")
            missing = numbers(" ".join(cells)) - numbers(details)
            assert not missing, f"{title}: {first.strip()}: {missing} is not in the folded part"


def test_kept_rows_are_in_the_table_of_the_studies():
    commands = {path.stem for path in (ROOT / "docs").glob("make_*.py") if '"studies")' in path.read_text("utf-8")}
    assert commands - {"make_rows"} <= {*make_rows.STUDIES}
    kept = {path.name.removesuffix(".csv.gz") for path in (ROOT / "docs/rows").iterdir()}
    assert kept <= {name for names in make_rows.STUDIES.values() for name in names}
    assert make_rows.table() in (ROOT / "docs/studies.md").read_text("utf-8"), "python -m docs.make_rows"


def test_modules_and_equations_of_the_theory_exist():
    theory = (ROOT / "docs/theory.md").read_text(encoding="utf-8")
    modules = {path.name for folder in ("auvid_cli", "tests") for path in (ROOT / folder).rglob("*.py")}
    assert {name.split("/")[-1] for name in re.findall(r"`([\w/]+\.py)`", theory)} <= modules
    blocks = re.findall(r"(?ms)^```math\n(.*?)^```", theory)
    every = list(range(1, len(blocks) + 1))
    assert [int(n) for block in blocks for n in re.findall(r"\\qquad \((\d+)\)", block)] == every
    sources = re.findall(r"(?m)^\| ([\d, ]+) \|", theory.partition("## Sources of the equations")[2])
    assert [int(n) for row in sources for n in row.split(",")] == every


def test_pictures_are_what_their_commands_draw():
    assert conventions() == make_conventions.TARGET.read_text(encoding="utf-8"), "python docs/make_conventions.py"
    assert timeline() == make_timeline.TARGET.read_text(encoding="utf-8"), "python docs/make_timeline.py"


@pytest.mark.parametrize("path", sorted((ROOT / "configs/vehicles").glob("*.yaml")), ids=lambda path: path.stem)
def test_fins_of_shipped_vehicles_have_the_signs_of_the_picture(path):
    vehicle = load_experiment(find_experiment(None), [f"vehicle={path}"]).vehicle
    signs = {symbol: math.copysign(1, vehicle.all_coefficients()[symbol]) for symbol in FIN_SIGNS}
    assert signs == FIN_SIGNS
