"""Rounding and saturation."""

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.simulation import Converter


def test_levels_of_twelve_bits():
    converter = Converter(5.0, bits=12)
    assert converter.step == 10 / 4096
    converted, saturated = converter.convert(np.linspace(-5.1, 5.1, 100_001))
    levels = np.unique(converted)
    assert len(levels) == 4096
    np.testing.assert_allclose(levels, np.arange(-2048, 2048) * 10 / 4096, atol=1e-15)
    assert saturated == pytest.approx(0.2 / 10.2, abs=1e-3)


def test_rounds_to_the_nearest_level():
    converter = Converter(1.0, bits=8)
    values = np.random.default_rng(0).uniform(-0.99, 0.99, (50, 3))
    converted, saturated = converter.convert(values)
    assert converted.shape == values.shape
    assert saturated == 0.0
    assert abs(converted - values).max() <= converter.step / 2


def test_an_amplifier_before_the_converter():
    values = np.linspace(-0.1, 0.1, 101)
    referred, saturated = Converter(5.0).convert(values, gain=100.0)
    behind, same = Converter(5.0).convert(100.0 * values)
    np.testing.assert_allclose(100.0 * referred, behind, atol=1e-12)
    assert saturated == same > 0.4


def test_no_codes_only_saturation():
    converted, saturated = Converter(2.0, bits=None).convert([-3.0, 0.123456789, 2.0])
    assert converted.tolist() == [-2.0, 0.123456789, 2.0]
    assert saturated == pytest.approx(1 / 3)


@pytest.mark.parametrize(("limit", "bits"), [(0.0, 12), (5.0, 0), (np.nan, 12)])
def test_converters_that_are_none(limit, bits):
    with pytest.raises(InputError, match="positive"):
        Converter(limit, bits=bits)
