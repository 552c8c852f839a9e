"""Every weight and nominal of chapter 5: the default fit is never worse than SLICOT's SB10YD."""

import numpy as np
import pytest
from lanes import thinned
from workbench.plants.cd_drive.uncertainty.measured_drives import measured_drives

from workbench import solve
from workbench.fitting import MagnitudeFit, ResponseFit
from workbench.geometry import narrowest_stadium, smallest_circle
from workbench.uncertainty.covers.orientation import limited_orientation
from workbench.uncertainty.covers.sets import stadiums_about_nominal
from workbench.uncertainty.covers.weights import needed_radius, unwrapped

AXES = ("focus", "radial")
ORDER = 4
FREQUENCIES = 150


def family(axis):
    return measured_drives(axis, FREQUENCIES, 5.0, 5000.0)


def nominal(axis):
    from workbench.plants.cd_drive.drive.plants import nominal_response

    return nominal_response(axis, family(axis).frequency_hz, antialiasing=False)


def away(axis):
    return family(axis).points / nominal(axis)[:, None] - 1


def third(axis):
    return stadiums_about_nominal(away(axis), limited_orientation()(family(axis).omega, away(axis)))


def radii(axis, kind):
    if kind == "circle":
        return np.abs(away(axis)).max(axis=1)
    sets = third(axis)
    return needed_radius(away(axis), sets.half_length * np.exp(1j * sets.angle))


def centres(axis, kind):
    first = smallest_circle if kind == "circle" else narrowest_stadium
    return first(family(axis).points).center


def worst(program, method):
    solution = solve(program, method=method)
    if solution.certificate is None or not solution.certificate.valid:
        return np.inf  # SB10YD gives unstable fits now and then
    return program.metrics(solution.answer)["error_worst"]


@pytest.mark.cases(2)
@pytest.mark.parametrize("cover", [False, True])
@pytest.mark.parametrize("kind", ["circle", "stadium"])
@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_complex_weights(axis, kind, cover):
    program = MagnitudeFit(family(axis).omega, radii(axis, kind), ORDER, cover=cover)
    assert worst(program, None) <= worst(program, "sb10yd")


@pytest.mark.cases(1)
@pytest.mark.parametrize("minimum_phase", [False, True])
@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_real_weights(axis, minimum_phase):
    sets = third(axis)
    end = unwrapped(np.maximum(sets.half_length, 1e-6) * np.exp(1j * sets.angle))
    program = ResponseFit(family(axis).omega, end, ORDER, minimum_phase=minimum_phase)
    assert worst(program, None) <= worst(program, "sb10yd")


@pytest.mark.parametrize("kind", ["circle", "stadium"])
@pytest.mark.parametrize("axis", AXES)
def test_nominals(axis, kind):
    program = ResponseFit(family(axis).omega, centres(axis, kind), ORDER)
    found = worst(program, None)
    assert found <= worst(program, "sb10yd")
    assert found < 0.5
