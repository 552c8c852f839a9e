"""The pins of requirements.txt with the oldest NumPy and SciPy that pyproject.toml allows."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]


def requirements() -> str:
    """Text of a requirements file."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    pins = (ROOT / "requirements.txt").read_text(encoding="utf-8")
    for name in ("numpy", "scipy"):
        (least,) = (
            least for least in table["project"]["dependencies"] if least.startswith(f"{name}>=")
        )
        pins, found = re.subn(rf"^{name}==.*$", least.replace(">=", "=="), pins, flags=re.MULTILINE)
        assert found == 1, name
    return pins


if __name__ == "__main__":
    print(requirements())
