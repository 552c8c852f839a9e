"""A drive on the bench against its analytic model, its own sensitivity, and itself."""

import control
import numpy as np
import pytest
from timing import least_seconds
from workbench.plants.cd_drive.drive import plants as drives
from workbench.plants.cd_drive.drive import tables
from workbench.plants.cd_drive.drive.disc import Defect, Disc
from workbench.plants.cd_drive.laboratory.bench_setup import COIL_GAIN, PERIOD, RATE
from workbench.plants.cd_drive.laboratory.experiment import MEASUREMENTS, Laboratory

from workbench._core.compiled import compiled
from workbench.errors import InputError
from workbench.simulation import Controller, linear_controller

AXES = ("focus", "radial")
QUIET = {"noise": 0.0, "electronics": 0.0, "bits": None}
LINES = np.array([20, 47, 100, 310, 500, 800, 1500, 3000])


def law(axis):
    return linear_controller(drives.controller(axis), PERIOD)


def disc(axis, share=1.0, **options):
    """A share of the deviation that the Red Book allows."""
    red_book = share * tables.red_book(axis).deviation
    return Disc.along(axis, red_book, **options)


def multisine(amplitude, periods=4):
    """Sines at LINES [Hz] with random phases, sampled; a period lasts a second."""
    instants = np.arange(periods * round(RATE)) / RATE
    phases = np.random.default_rng(0).uniform(0, 2 * np.pi, len(LINES))
    return amplitude * np.sin(2 * np.pi * np.outer(instants, LINES) + phases).sum(axis=1)


def lines(signal):
    """Phasors at LINES of the last second."""
    return np.fft.rfft(signal[-round(RATE) :])[LINES]


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("delay", [0.0, 1.0, 1.6])
def test_frequency_response_measured_by_sines(axis, delay):
    bench = Laboratory(axis, "CD3", delay=delay, **QUIET)
    record = bench.open_loop(multisine(1e-4 if axis == "focus" else 2e-5))
    assert abs(record.x).max() < (2e-6 if axis == "focus" else 0.05e-6)
    sampled = bench.response(LINES)
    tolerance = {"x": 1e-7, "v_r": 1e-9, "u_m": 1e-9, "f_en": 1e-4 if axis == "focus" else 0.01}
    for name, response in sampled.items():
        measured = lines(getattr(record, name)) / lines(record.u)
        np.testing.assert_allclose(measured, response, rtol=tolerance[name])
    s = 2j * np.pi * LINES
    hold = (1 - np.exp(-s * PERIOD)) / (s * PERIOD) * np.exp(-s * delay * PERIOD)
    index = [drive.name for drive in tables.drives(axis)].index("CD3")
    analytic = -drives.responses(axis, LINES)[index] * hold  # eq. 3.16 turns the sign
    np.testing.assert_allclose(sampled["f_en"], analytic, rtol=0.01)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("gain", ["own", "equal", "agc"])
def test_total_gain_results(axis, gain):
    table = drives.responses(axis, [40.0, 600.0], gain, "corrected")
    for row, drive in list(zip(table, tables.drives(axis), strict=True))[::4]:
        bench = Laboratory(axis, drive.name, "corrected", gain, delay=0.0)
        found = abs(bench.response([40.0, 600.0])["f_en"])
        np.testing.assert_allclose(found, abs(row), rtol=5e-3)


def test_coil_current_has_equation_4_17():
    """v_r / u_m: filter, hold and delay drop out, r / (R + r) is left far from the resonance."""
    bench = Laboratory("focus", "CD5", **QUIET)
    ratio = bench.response([0.1, 2e3])
    ratio = ratio["v_r"] / ratio["u_m"] / bench.coil_gain
    np.testing.assert_allclose(ratio, 1.25 / (bench.parameters.R + 1.25), rtol=2e-3)


@pytest.mark.parametrize("axis", AXES)
def test_quick_coil_experiment_is_the_full_one(axis):
    u = multisine(0.1, periods=1)[:4000]
    bench = Laboratory(axis, "CD7", delay=1.3)
    quick, full = Laboratory(axis, "CD7", delay=1.3, **QUIET).coil(u), bench.open_loop(u)
    step = 10 / 4096 / COIL_GAIN
    assert abs(quick.v_r - full.v_r).max() < 6.5 * step
    rounded = bench.coil(u)
    assert (rounded.u_dac == full.u_dac).all()
    np.testing.assert_allclose(rounded.v_r / step, np.round(rounded.v_r / step), atol=1e-9)
    noise = (rounded.v_r - Laboratory(axis, "CD7", delay=1.3, electronics=0.0).coil(u).v_r) / step
    assert noise.std() == pytest.approx(1.0, abs=0.15)


def test_saturation_is_counted():
    record = Laboratory("focus", "CD1").coil(np.r_[np.zeros(5000), np.full(5000, 11.0)])
    assert record.saturation["u"] == 0.5
    assert record.saturation["v_r"] == pytest.approx(0.5, abs=0.01)
    assert record.saturation["u_m"] == 0.0
    assert record.u_dac.max() == 10.0 - 20 / 4096
    assert record.v_r.max() * COIL_GAIN == pytest.approx(5.0 - 10 / 4096)


def test_second_parasitic_resonance():
    frequency = np.arange(300.0, 900.0, 2.0)
    single, none, double = (
        Laboratory("focus", "CD12", mismatch=mismatch).actuator for mismatch in (0.0, 1e-9, 0.5)
    )
    np.testing.assert_allclose(none.response(frequency), single.response(frequency), rtol=1e-7)
    resonant = abs(double.poles())[2:] / (2 * np.pi)
    assert len(resonant) == 4
    assert 1.1 < resonant[2] / resonant[0] < 2.0
    departure = abs(double.response(frequency) / single.response(frequency) - 1)
    assert departure.max() > 0.03
    with pytest.raises(InputError, match="mismatch"):
        _ = Laboratory(mismatch=1.0).actuator


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("rotation", [4.0, 9.0])
def test_residual_is_what_the_sensitivity_predicts(axis, rotation):
    bench = Laboratory(axis, "nominal", **QUIET)
    share = 1.0 if axis == "focus" else 0.1  # the radial error is a sine: linear while small
    moving = disc(axis, share, rotation=rotation, run_up=0.5)
    record = bench.closed_loop(law(axis), disc=moving, duration=2.0)
    assert record.events == ()
    whole = round(RATE)
    error = (record.x_cd - record.x)[-whole:]
    phasor = 2 * abs(np.fft.rfft(error)[round(rotation)]) / whole
    z = np.exp(2j * np.pi * rotation * PERIOD)
    K = control.sample_system(control.ss(drives.controller(axis)), PERIOD, "bilinear")(z)
    sensitivity = 1 / (1 - K * bench.response([rotation])["f_en"][0])
    expected = abs(sensitivity) * share * tables.red_book(axis).deviation
    assert phasor == pytest.approx(expected, rel=0.01)
    assert abs(error).max() == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("axis", AXES)
def test_every_drive_follows_a_disc_of_the_red_book(axis):
    for drive in tables.drives(axis):
        record = Laboratory(axis, drive.name).closed_loop(law(axis), disc=disc(axis), duration=0.6)
        error = (record.x_cd - record.x)[round(0.3 * RATE) :]
        assert record.events == ()
        assert abs(error).max() < (2e-6 if axis == "focus" else 0.4e-6)
        assert record.saturation["u"] == 0.0


def test_noise_of_the_measured_error():
    record = Laboratory("focus", "CD2").open_loop(np.zeros(round(RATE)))
    K_optn = tables.drives("focus")[1].K_optn
    assert record.f_en.std() / K_optn == pytest.approx(0.15e-6, rel=0.05)
    power = abs(np.fft.rfft(record.f_en)) ** 2
    assert power[1:1760].sum() > 0.97 * power[1:].sum()
    assert record.sum.std() / record.sum.mean() == pytest.approx(record.f_en.std(), rel=0.1)


def test_seed_decides_everything():
    runs = [Laboratory().closed_loop(law("focus"), duration=0.05, seed=n) for n in (4, 4, 5)]
    for name, values in runs[0].to_dataset().data_vars.items():
        assert (values.values == getattr(runs[1], name)).all()
    assert (runs[0].f_en != runs[2].f_en).any()


@pytest.mark.parametrize("axis", AXES)
def test_half_the_step_agrees(axis):
    scratch = Defect(depth=0.8, displacement=1e-6 if axis == "focus" else 0.05e-6)
    runs = [
        Laboratory(axis, "CD9", delay=1.4, refine=refine, **QUIET).closed_loop(
            law(axis), disc=disc(axis), defects=[scratch], duration=0.3
        )
        for refine in (1, 2)
    ]
    assert runs[0].light.min() == pytest.approx(0.2)
    np.testing.assert_allclose(runs[0].x, runs[1].x, rtol=0, atol=1e-9)


def test_normalisation_takes_the_light_out():
    u = multisine(1e-4, periods=1)[:3000]
    bright, dim = (
        Laboratory(**QUIET).open_loop(u, disc=Disc(rotation=0.0, reflectivity=light))
        for light in (1.0, 0.4)
    )
    np.testing.assert_allclose(dim.sum, 0.4 * bright.sum, rtol=1e-12)
    np.testing.assert_allclose(dim.f_en, bright.f_en, rtol=1e-9, atol=1e-15)
    dark = Laboratory().open_loop(u, disc=Disc(rotation=0.0, reflectivity=0.0))
    assert np.isfinite(dark.f_en).all()


def test_losing_and_regaining_focus():
    jump = np.r_[np.zeros(3000), np.full(3000, 0.5), np.zeros(8000)]
    record = Laboratory("focus", "CD1").open_loop(jump)
    kinds = [event.kind for event in record.events]
    assert kinds[:2] == ["focus lost", "focus regained"]
    assert record.events[0].time == pytest.approx(3000 / RATE, abs=3e-3)
    assert np.isfinite(record.f_en).all()
    lost = abs(record.x_cd - record.x) > 20e-6
    assert record.sum[lost].max() < 0.5 * record.sum[:3000].mean()
    assert "focus lost at 0.0" in record.to_dataset().attrs["events"]


def test_sideways_scan_crosses_tracks():
    record = Laboratory("radial", "CD1", **QUIET).open_loop(
        np.zeros(round(RATE / 2)), disc=disc("radial", run_up=0.0)
    )
    crossed = np.floor(record.x_cd / 1.6e-6)
    upward = np.count_nonzero(np.diff(np.sign(record.f_en)) > 0)
    # Half a second, three rotations: six slopes of twice 70 um; upward on three of them.
    assert upward == pytest.approx(np.abs(np.diff(crossed)).sum(), abs=6)
    K_optn = tables.drives("radial")[0].K_optn
    assert abs(record.f_en).max() == pytest.approx(K_optn * 1.6e-6 / (2 * np.pi), rel=0.01)
    assert record.events[0].kind == "track lost"


@compiled
def with_memory(state, parameters, measurement, output):
    """Proportional, but silent while the sum is low; counts how often it was."""
    state[0] += measurement[1] < parameters[0]
    output[0] = parameters[1] * measurement[0] if measurement[1] >= parameters[0] else 0.0


def test_a_controller_with_a_switch():
    bench = Laboratory("focus", "CD4")
    level = bench.parameters.K_opt / bench.parameters.K_optn
    switch = Controller(with_memory, np.zeros(1), np.array([0.5 * level, 0.5]))
    record = bench.closed_loop(switch, disc=Disc(), defects=[Defect(angle=0.1)], duration=0.1)
    low = record.sum < 0.5 * level
    assert 10 < np.count_nonzero(low) < 40
    assert (record.u[low] == 0.0).all()
    assert (record.u[~low] != 0.0).any()
    assert MEASUREMENTS[:2] == ("f_en", "sum")


def test_excitation_adds_to_the_controller():
    excitation = np.r_[np.zeros(100), 1.0, np.zeros(99)]
    bench = Laboratory(**QUIET)
    record = bench.closed_loop(law("focus"), excitation)
    assert (record.u[:100] == 0.0).all()
    assert record.u[100] == 1.0
    assert (record.x[:102] == 0.0).all()  # one sample late, and zero at the instant it comes
    assert record.x[102] > 0.0
    assert record.f_en[103] < 0.0


def test_refusals():
    bench = Laboratory()
    with pytest.raises(InputError, match="CD13"):
        Laboratory(drive="CD13").coil(np.zeros(5))
    with pytest.raises(InputError, match="1-D"):
        bench.coil(np.zeros((5, 2)))
    with pytest.raises(InputError, match="finite"):
        bench.open_loop([0.0, np.nan])
    with pytest.raises(InputError, match="duration"):
        bench.closed_loop(law("focus"), duration=0.0)
    with pytest.raises(InputError, match="end at 17500"):
        bench.response([18e3])


def test_a_second_of_a_drive_is_quick():
    """A tenth of real time at most, so that an ensemble of drives takes minutes."""
    bench, K = Laboratory(), law("focus")
    u = np.zeros(round(RATE))
    for experiment in (lambda: bench.closed_loop(K, u, disc=disc("focus")), lambda: bench.coil(u)):
        assert least_seconds(experiment, 5) < 0.1
