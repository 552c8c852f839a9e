"""Write docs/thesis.md, the page about the thesis, from the reference result of cd/claims."""

from pathlib import Path

import workbench as wb

ROOT = Path(__file__).parents[1]


def page() -> str:
    """The page as the committed results give it."""
    (folder,) = (ROOT / "results" / "reference" / "cd" / "claims").iterdir()
    run = wb.open_run(folder)
    return run.task.page(run.answer)


if __name__ == "__main__":
    Path(__file__).with_suffix(".md").write_text(page(), encoding="utf-8")
