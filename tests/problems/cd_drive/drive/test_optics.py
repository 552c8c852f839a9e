"""Readout beams against Table 2.2, and the shares of light that obstacles block."""

import math

import numpy as np
import pytest
from workbench.plants.cd_drive.drive import optics
from workbench.plants.cd_drive.drive.tables import disc_formats

from workbench import load, solve
from workbench.errors import InputError

FORMATS = disc_formats()


@pytest.mark.parametrize("name", FORMATS)
def test_equations_by_hand(name):
    disc, beam = FORMATS[name], optics.readout_beam(FORMATS[name])
    assert math.sin(math.radians(beam.theta1)) == pytest.approx(disc.NA)
    assert 1.55 * math.sin(math.radians(beam.theta2)) == pytest.approx(disc.NA)
    tangent = 1 / math.tan(math.radians(90 - beam.theta2))
    half = (beam.D - beam.d) / 2
    assert half == pytest.approx(disc.layer_thickness * tangent)
    assert beam.density == pytest.approx(1 / (2 * beam.d) ** 2)


@pytest.mark.parametrize(
    ("name", "exact", "printed"),
    [("CD", 710.8e-6, 716.3e-6), ("DVD", 504.3e-6, 509.9e-6), ("BRD", 131.4e-6, 130.1e-6)],
)
def test_printed_D_uses_whole_degrees(name, exact, printed):
    """Exact angles give 0.71 and 0.50 mm where the table prints 0.72 and 0.51."""
    disc = FORMATS[name]
    unrounded = optics.readout_beam(disc).D
    assert unrounded == pytest.approx(exact, abs=0.1e-6)
    rounded = optics.readout_beam(disc, whole_degrees=True).D
    assert rounded == pytest.approx(printed, abs=0.1e-6)
    assert round(rounded, 5) == disc.D


def test_blocked_shares():
    """By counting points of a uniform beam."""
    x, y = np.random.default_rng(0).uniform(-0.5, 0.5, (2, 400_000))
    inside = x**2 + y**2 < 0.25
    dust = np.mean((x**2 + y**2)[inside] < 0.15**2)
    hair = np.mean(abs(x[inside]) < 0.2)
    assert optics.blocked_by_particle(1.0, 0.3) == pytest.approx(dust, abs=3e-3)
    assert optics.blocked_by_hair(1.0, 0.4) == pytest.approx(hair, abs=3e-3)
    assert optics.blocked_by_particle(1.0, 2.0) == 1.0
    assert optics.blocked_by_hair(1.0, 2.0) == pytest.approx(1.0)


def test_problem():
    study = load("cd/optics")
    solution = solve(study)
    assert solution.certificate.holds
    metrics = study.metrics(solution.answer)
    assert metrics["printed_D_missed_by_exact_angles"] == 2
    assert metrics["blocked_by_dust_CD"] == pytest.approx(0.0032, abs=1e-4)
    assert metrics["blocked_by_dust_BRD"] == pytest.approx(0.0927, abs=1e-4)
    assert metrics["density_BRD_over_CD"] == pytest.approx(13.2, abs=0.1)
    assert metrics["depth_of_focus_CD_m"] == pytest.approx(metrics["d_CD_m"] / 0.45)
    assert metrics["wavelength_inside_CD_m"] == pytest.approx(503e-9, abs=1e-9)
    assert metrics["capacity_DVD_most_over_CD"] == pytest.approx(17 / 0.65)
    assert metrics["capacity_BRD_least_over_CD"] == pytest.approx(23.3 / 0.7)
    assert set(study.figures(solution.answer)) == {"out-of-focus"}
    table = " ".join(study.tables(solution.answer)["table-2-2"].split())
    assert "| CD | D [m] | 0.00072 | 0.0007108 | 0.0007163 |" in table


def test_a_wrong_beam_is_found():
    study = load("cd/optics")
    answer = solve(study).answer
    answer["beam_whole_degrees"].loc["CD", "D"] += 10e-6
    answer["beam"].loc["DVD", "theta2"] += 0.1
    assert {"Table 2.2, D", "refraction"} <= {
        check.name for check in study.certify(answer, 1e-6).checks if not check.holds
    }


def test_bad_sizes():
    with pytest.raises(InputError, match="dust"):
        load("cd/optics", dust=-1e-6)
