"""Figures that pages quote, and the committed results that they are read from.

A quoted figure stands before a comment that names its file in `docs/evidence/results` and its place there:
`180<!-- = diagnosis: sentences right -->`. Files are what benchmarks write with `--json` (the place is a row's
name), or other JSON (the place is a path of keys, `flights/walk/flown_s`); `* 1000` after the place scales, as from
metres to mm.

python tools/results.py              writes every quoted figure anew from the committed results
python tools/results.py build/bench  first takes over what this folder has of the committed files (also `demo-out`)
"""

import json
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "docs" / "evidence" / "results"
QUOTE = re.compile(
    r"(?P<said>None|no|[-+]?\d[\d,]*(?:\.\d+)?|[-+]?\.\d+)"
    r"<!-- = (?P<file>\w+): (?P<place>[^>*]+?)(?: \* (?P<scale>\d+))? -->"
)
WORDS = ("None", "no")
"""In place of 0."""


def pages() -> list[Path]:
    """Pages whose figures are quoted."""
    docs = [page for page in (ROOT / "docs").rglob("*.md") if "_build" not in page.parts]
    return [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(docs)]


def value(file: str, place: str) -> float:
    """A committed figure.

    Raises:
        KeyError: there is no such file, row or key.
    """
    body = _read(file)
    if "rows" in body:
        rows = {row["name"]: row["value"] for row in body["rows"]}
        return float(rows[place])
    found: Any = body
    for key in place.split("/"):
        found = found[int(key)] if isinstance(found, list) else found[key]
    return float(found)


@cache
def _read(file: str) -> dict[str, Any]:
    path = RESULTS / f"{file}.json"
    if not path.is_file():
        raise KeyError(f"{path} does not exist")
    return json.loads(path.read_text())


def renewed(text: str) -> str:
    """The page with every quoted figure as the results have it, to as many digits as it had."""
    return QUOTE.sub(_quoted, text)


def _quoted(quote: re.Match[str]) -> str:
    said, exact = quote["said"], value(quote["file"], quote["place"]) * float(quote["scale"] or 1)
    mark = quote[0][len(said) :]
    if said in WORDS and exact == 0.0:
        return said + mark
    decimals = len(said.partition(".")[2])
    new = f"{exact:,.{decimals}f}"
    return (new.removeprefix("0") if said.startswith(".") else new) + mark


def _taken_over(committed: Any, measured: Any) -> Any:
    """The new figures; of JSON without rows only at the places that are committed, to six digits."""
    if isinstance(committed, dict):
        if "rows" in committed:
            return measured
        return {key: _taken_over(old, measured[key]) for key, old in committed.items()}
    if isinstance(committed, list):
        return [_taken_over(*pair) for pair in zip(committed, measured, strict=True)]
    return float(f"{measured:.6g}") if isinstance(measured, float) else measured


def main(folder: Path | None) -> None:
    if folder is not None:
        for file in sorted(RESULTS.glob("*.json")):
            if (folder / file.name).is_file():
                taken = _taken_over(json.loads(file.read_text()), json.loads((folder / file.name).read_text()))
                file.write_text(json.dumps(taken, indent=1) + "\n")
    for page in pages():
        text = page.read_text()
        if renewed(text) != text:
            page.write_text(renewed(text))
            print(f"renewed the figures of {page.relative_to(ROOT)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
