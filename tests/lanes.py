"""Parameters that the quick tests try in part and `make test-all` as a whole."""

from collections.abc import Iterable
from typing import Any

import pytest


def thinned(values: Iterable[Any], every: int) -> list[Any]:
    """All values; all but one in `every`, from the first on, are marked slow."""
    return [
        pytest.param(value, marks=() if k % every == 0 else pytest.mark.slow)
        for k, value in enumerate(values)
    ]
