"""Words of README and docs beside their budgets; a page above its own is marked.

python tools/word_budget.py

Only studies are left out, and what the build writes in place of a mark such as `<!-- generated: effects -->`.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
TOTAL, LONGEST = 32_000, 2_500
"""Of README and docs without studies and generated text, and of any page outside studies."""
BUDGETS = {
    "README.md": 700,
    "CONTRIBUTING.md": 600,
    "CHANGELOG.md": 400,
    "docs/index.md": 250,
    "docs/start/install.md": 300,
    "docs/start/tour.md": 600,
    "docs/start/plan_in_a_mesh.md": 500,
    "docs/start/learn_from_a_log.md": 700,
    "docs/start/journeys.md": 700,
    "docs/how-to/map.md": 900,
    "docs/how-to/other_maps.md": 700,
    "docs/how-to/camera.md": 600,
    "docs/how-to/plan.md": 900,
    "docs/how-to/missions.md": 800,
    "docs/how-to/cluster.md": 500,
    "docs/how-to/import_log.md": 900,
    "docs/how-to/import_a_map.md": 400,
    "docs/how-to/identify.md": 900,
    "docs/how-to/find_a_missing_effect.md": 900,
    "docs/how-to/vehicle.md": 700,
    "docs/how-to/fly.md": 1000,
    "docs/how-to/first_flight.md": 700,
    "docs/how-to/station.md": 1200,
    "docs/reference/formats.md": 2000,
    "docs/reference/link.md": 2000,
    "docs/reference/messages.md": 300,
    "docs/reference/glossary.md": 1000,
    "docs/explain/architecture.md": 700,
    "docs/explain/distance_field.md": 1200,
    "docs/explain/gate.md": 800,
    "docs/explain/estimator.md": 1500,
    "docs/explain/diagnosis.md": 1200,
    "docs/explain/controller.md": 1200,
    "docs/explain/trust.md": 900,
    "docs/evidence/performance.md": 2000,
}
"""By page; others may have as much as `LONGEST`."""


def pages() -> list[Path]:
    """README, CONTRIBUTING, changelog and every page of the docs but studies."""
    docs = [page for page in (ROOT / "docs").rglob("*.md") if not {"_build", "studies"} & set(page.parts)]
    return [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")] + sorted(docs)


def count(page: Path) -> int:
    """Words of a page that a reader sees, code and tables included; comments, pictures and fences are none."""
    text = re.sub(r"<!--.*?-->|<picture>.*?</picture>", "", page.read_text(), flags=re.DOTALL)
    return len([word for word in text.split() if not word.startswith("```")])


def total() -> int:
    """Words of README and docs, as `wc -w` counts them: markup, comments and the bars of tables too."""
    return sum(len(page.read_text().split()) for page in pages() if page.name == "README.md" or page.parent != ROOT)


def above() -> list[str]:
    """A sentence for each page above its budget, and for the sum."""
    counts = {str(page.relative_to(ROOT)): count(page) for page in pages()}
    budgets = {name: BUDGETS.get(name, LONGEST) for name in counts}
    found = [f"{name}: {n} words of {budgets[name]}" for name, n in counts.items() if n > budgets[name]]
    return found + ([f"README and docs: {total()} words of {TOTAL}"] if total() > TOTAL else [])


def main() -> None:
    for page in pages():
        name = str(page.relative_to(ROOT))
        words, budget = count(page), BUDGETS.get(name, LONGEST)
        print(f"{words:6} of {budget:5}  {name}{'  ABOVE' if words > budget else ''}")
    print(f"{total():6} of {TOTAL:5}  README and docs")
    print(*above(), sep="\n")


if __name__ == "__main__":
    sys.exit(main())
