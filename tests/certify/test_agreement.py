"""Two proven bounds of one number: any crossing is an error, and equal ones agree."""

import numpy as np
import pytest

from workbench.certify.agreement import need_agreement
from workbench.errors import ContradictionError


def test_bounds_that_touch_agree():
    need_agreement(1.0, 1.0)
    need_agreement([0.0, 1.0], [0.0, np.inf])


@pytest.mark.parametrize("lower", [np.nextafter(1.0, 2.0), 1.005, 3.0])
def test_bounds_that_cross_by_anything_are_an_error(lower):
    with pytest.raises(ContradictionError, match=r"mu at index \(1,\)"):
        need_agreement([0.5, lower], [1.0, 1.0])
