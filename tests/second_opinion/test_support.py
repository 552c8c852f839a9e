"""Support functions agree with distances."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from workbench.second_opinion.support import reach_beyond

number = st.floats(-10, 10, allow_subnormal=False)


@given(re=number, im=number, angle=st.floats(0, 3.14), h=st.floats(0, 5), r=st.floats(0, 5))
def test_reach_beyond_a_stadium_is_the_distance_from_it(re, im, angle, h, r):
    point, center = complex(re, im), 1 - 2j
    away = (point - center) * np.exp(-1j * angle)
    distance = abs(away - np.clip(away.real, -h, h)) - r
    found = reach_beyond(np.array([point]), *map(np.asarray, (center, r, h, angle)))[0]
    assert found <= distance + 1e-12
    if distance > 0:
        assert found > distance - 2e-3 * abs(point - center) - 1e-12
