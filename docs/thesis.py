"""Write the pages about the thesis from the reference result of cd/claims.

docs/thesis.md has the verdicts, docs/thesis-numbers.md every number.
"""

from pathlib import Path

import workbench as wb

ROOT = Path(__file__).parents[1]


def pages() -> dict[str, str]:
    """The pages by name, as the committed results give them."""
    (folder,) = (ROOT / "results" / "reference" / "cd" / "claims").iterdir()
    run = wb.open_run(folder)
    return {
        "thesis.md": run.task.page(run.answer),
        "thesis-numbers.md": run.task.numbers_page(run.answer),
    }


if __name__ == "__main__":
    for name, text in pages().items():
        (Path(__file__).parent / name).write_text(text, encoding="utf-8")
