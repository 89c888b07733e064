"""Every figure that README and docs quote from a measurement is what the committed result says."""

import json
import re

import pytest

from tools import results


@pytest.mark.parametrize("page", results.pages(), ids=lambda page: str(page.relative_to(results.ROOT)))
def test_quoted_figures_are_those_of_the_committed_results(page):
    text = page.read_text()
    stale = [
        f"{old[0]}: now {new['said']}"
        for old, new in zip(results.QUOTE.finditer(text), results.QUOTE.finditer(results.renewed(text)), strict=True)
        if old["said"] != new["said"]
    ]
    assert not stale, "python tools/results.py writes them anew"
    assert text.count("<!-- = ") == len(results.QUOTE.findall(text)), "a mark has no figure before it"


def test_no_figure_of_the_readmes_claims_is_typed_by_hand():
    text = (results.ROOT / "README.md").read_text()
    claims = text.split("## What nothing else does")[1].split("\n## ")[0]
    typed = re.sub(r"x86-64|x86|Cortex-M\d\w?|\bM\d\b|C\d\d", "", results.QUOTE.sub("", claims))
    assert not re.findall(r"\d[\d,.]*", typed)


def test_a_wrong_figure_is_noticed_and_written_anew_with_as_many_digits():
    mark = "<!-- = demo: flights/walk/tracking_mean_m * 1000 -->"
    right = results.renewed(f"1.0{mark}")
    assert results.renewed(f"1{mark}") != right
    assert float(right.removesuffix(mark)) == round(1000 * results.value("demo", "flights/walk/tracking_mean_m"), 1)
    with pytest.raises(KeyError):
        results.renewed("1<!-- = demo: flights/nowhere -->")


def test_a_run_renews_the_committed_places_alone(tmp_path, monkeypatch):
    committed = tmp_path / "committed"
    committed.mkdir()
    (committed / "demo.json").write_text('{"a": {"b": [1.0, null]}}')
    (tmp_path / "demo.json").write_text('{"a": {"b": [2.00000049, "s"], "c": 3}, "files": {}}')
    monkeypatch.setattr(results, "RESULTS", committed)
    monkeypatch.setattr(results, "pages", list)
    results.main(tmp_path)
    assert json.loads((committed / "demo.json").read_text()) == {"a": {"b": [2.0, "s"]}}
