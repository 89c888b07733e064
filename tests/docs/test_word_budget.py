"""Pages keep to their budgets of words; one above its own is a warning, one that nobody will read an error."""

import warnings

from tools import word_budget


def test_pages_above_their_budget_are_named():
    for sentence in word_budget.above():
        warnings.warn(sentence, stacklevel=1)
    assert word_budget.count(word_budget.ROOT / "README.md") <= word_budget.BUDGETS["README.md"]
    assert all(word_budget.count(page) <= 1.2 * word_budget.LONGEST for page in word_budget.pages())


def test_comments_and_fences_are_no_words(tmp_path):
    (tmp_path / "page.md").write_text("Two words\n<!-- run: map -->\n```text\ngoshawk demo\n```\n")
    assert word_budget.count(tmp_path / "page.md") == 4


def test_a_table_that_a_tool_wrote_is_reading_too(tmp_path):
    (tmp_path / "page.md").write_text("Two words\n\n<!-- written by a tool -->\n\n| a | b |\n|---|---|\n")
    assert word_budget.count(tmp_path / "page.md") == 8


def test_every_page_but_studies_counts_towards_the_sum():
    docs = {page for page in (word_budget.ROOT / "docs").rglob("*.md") if not {"_build", "studies"} & set(page.parts)}
    assert docs < set(word_budget.pages())
    assert word_budget.total() == sum(len(page.read_text().split()) for page in [*docs, word_budget.ROOT / "README.md"])
