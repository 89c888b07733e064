"""The Python pages lose no text of a docstring, show no private name, and have every public one."""

import importlib
import inspect
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

ROOT = Path(__file__).parents[2]
PAGES = sorted(page for page in (ROOT / "docs" / "reference" / "python").glob("*.md") if page.stem != "index")
PACKAGES = {page.stem for page in PAGES}
FIELD = re.compile(r"^\s{4,}[\w*, `]+(?: \([^)]*\))?: ")
"""The head of an entry under `Args:` or `Raises:`, which is set apart from its text."""
HEADINGS = ("Args:", "Returns:", "Raises:", "Yields:")


class Text(HTMLParser):
    """The text of a page, and the names that its links may lead to."""

    def __init__(self) -> None:
        super().__init__()
        self.parts: list[str] = []
        self.names: list[str] = []

    def handle_data(self, data: str) -> None:
        self.parts.append(data)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names += [value for name, value in attrs if name == "id" and value and tag == "dt"]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Text]:
    """Every page of the Python reference, built as `make docs` builds it: a warning is an error."""
    out = tmp_path_factory.mktemp("docs")
    app = Sphinx(ROOT / "docs", ROOT / "docs", out, out / "doctrees", "html", warningiserror=True, status=None)
    app.build()
    assert app.statuscode == 0
    read = {}
    for page in PAGES:
        read[page.stem] = Text()
        read[page.stem].feed((out / "reference" / "python" / f"{page.stem}.html").read_text())
    return read


def modules(page: Path) -> list[str]:
    return re.findall(r"automodule:: ([\w.]+)", page.read_text())


def values(module: str) -> list[object]:
    """Of the names in a module's `__all__`."""
    found = importlib.import_module(module)
    return [getattr(found, name) for name in getattr(found, "__all__", ())]


def public(module: str) -> Iterator[tuple[str, object]]:
    """The classes and functions that a module offers: its `__all__`, or what it defines itself."""
    found = importlib.import_module(module)
    names = getattr(found, "__all__", None) or [n for n in vars(found) if not n.startswith("_")]
    for name in names:
        value = getattr(found, name)
        of_code = inspect.isclass(value) or inspect.isfunction(value)
        if of_code and (hasattr(found, "__all__") or value.__module__ == module):
            yield name, value


def offered(module: str) -> Iterator[str]:
    """Full names of what must be on its page: also constants, methods, properties and fields, inherited ones too."""
    found = importlib.import_module(module)
    yield from (
        f"{module}.{name}" for name in getattr(found, "__all__", ()) if not inspect.ismodule(getattr(found, name))
    )
    for name, value in public(module):
        yield f"{module}.{name}"
        if inspect.isclass(value) and value.__name__ == name:  # another's class under a second name stands there
            for owner in value.__mro__:
                if owner.__module__.partition(".")[0] in PACKAGES:
                    yield from (f"{module}.{name}.{member}" for member in vars(owner) if not member.startswith("_"))


def texts(value: object) -> Iterator[str]:
    """Docstrings of a function or a class, its public methods and fields."""
    yield inspect.getdoc(value) or ""
    if not inspect.isclass(value) or value.__module__.rpartition(".")[2].startswith("_"):  # compiled: no source
        return
    for name, member in vars(value).items():
        if shown(name) and (inspect.isroutine(member) or isinstance(member, property)):
            yield member.__doc__ or ""
    notes = ModuleAnalyzer.for_module(value.__module__).find_attr_docs()
    yield from ("\n".join(said) for (owner, name), said in notes.items() if owner == value.__name__ and shown(name))


def shown(name: str) -> bool:
    return not name.startswith("_") or name == "__init__"


def lines(text: str) -> Iterator[str]:
    """What must be on the page of a docstring, letters and digits only, line by line."""
    for line in text.splitlines():
        if line.strip() not in HEADINGS:
            yield letters(FIELD.sub("", line))


def letters(text: str) -> str:
    return re.sub(r"[\W_]", "", text)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_no_text_of_a_docstring_is_lost(page: Path, built: dict[str, Text]):
    text = letters("".join(built[page.stem].parts))
    for module in modules(page):
        notes = [inspect.getdoc(importlib.import_module(module)) or ""]
        notes += [note for _, value in public(module) for note in texts(value)]
        lost = [line for note in notes for line in lines(note) if line not in text]
        assert not lost, f"{module}: {lost[:5]}"


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_no_private_name_is_shown_and_every_public_one_is(page: Path, built: dict[str, Text]):
    text = built[page.stem]
    parts = [part for name in text.names for part in name.split(".")]
    assert not [part for part in parts if part.startswith("_")]
    assert not re.findall(r"[(,]\s*_[a-z]\w*\s*:", "".join(text.parts))
    missing = {name for module in modules(page) for name in offered(module)} - set(text.names)
    assert not missing
    parts_of_it = {value.__name__ for value in values(modules(page)[0]) if inspect.ismodule(value)}
    assert parts_of_it <= set(modules(page)), "modules that the package offers"
