"""The command `workbench`: starts this project, and no other package that is imported so.

Another distribution on PyPI installs a package that is imported as `workbench` too. Where both are
in one environment, whichever was installed last has its files there. The command lives in a module
of a name of its own, so that it can say so.
"""

from __future__ import annotations

import importlib.util
import sys


def main() -> None:
    """Run the command line, if the package that is imported as ``workbench`` is this project's."""
    found = importlib.util.find_spec("workbench")
    if found is None or importlib.util.find_spec("workbench.certify") is None:
        place = "no package" if found is None else f"the package at {found.origin}"
        sys.exit(
            f"workbench: `import workbench` finds {place}, which is not that of robust-workbench: "
            "another distribution uses the same name. Install robust-workbench into an "
            "environment of its own, or after the other: "
            "pip install --force-reinstall --no-deps robust-workbench"
        )
    from workbench.cli import main as command

    command()


if __name__ == "__main__":
    main()
