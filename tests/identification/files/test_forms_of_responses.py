"""One frequency response as instruments write it: the same values, or a clear refusal."""

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.identification import read_response
from workbench.uncertainty import Responses

F = np.array([1.0, 2.0, 5.0, 10.0])
G = np.array([2.0 + 0j, 1.0 - 1.5j, -0.5 - 1.0j, -0.3 + 0.1j])
MAGNITUDE, TURN = np.abs(G), np.unwrap(np.angle(G))
DECIBELS, DEGREES = 20 * np.log10(MAGNITUDE), np.degrees(TURN)


def table(head, *columns, mark=","):
    rows = [mark.join(each if isinstance(each, str) else repr(float(each)) for each in row)
            for row in zip(*columns, strict=True)]  # fmt: skip
    return "\n".join([head, *rows, ""])


def texts(form):
    return [form.format(re=z.real, im=z.imag) for z in G]


FORMS = {
    "parts": (table("f,re,im", F, G.real, G.imag), "f", ("re", "im")),
    "kHz": (table("f_kHz,Re(G),Im(G)", F / 1e3, G.real, G.imag), "f_kHz", ("Re(G)", "Im(G)")),
    "mHz and MHz": (table("f_mHz,re,im", F * 1e3, G.real, G.imag), "f_mHz", ("re", "im")),
    "rad/s": (table("w [rad/s],re,im", F * 2 * np.pi, G.real, G.imag), "w", ("re", "im")),
    "omega": (table("omega,re,im", F * 2 * np.pi, G.real, G.imag), "omega", ("re", "im")),
    "rpm": (table("f [rpm],re,im", F * 60, G.real, G.imag), "f", ("re", "im")),
    "decibels and degrees": (
        table("Frequency (Hz),Magnitude (dB),Phase (deg)", F, DECIBELS, DEGREES),
        "Frequency (Hz)", ("Magnitude (dB)", "Phase (deg)"),
    ),
    "their names without units": (
        table("Frequency (Hz),Magnitude (dB),Phase (deg)", F, DECIBELS, DEGREES),
        "Frequency", ("Magnitude", "Phase"),
    ),
    "a row of units": (
        table("f,mag,phase\nHz,dB,deg", F, DECIBELS, DEGREES), "f", ("mag", "phase"),
    ),
    "parts of a gain": (
        table("f,real(gain),imag(gain)", F, G.real, G.imag), "f", ("real(gain)", "imag(gain)"),
    ),
    "suffixes": (table("f_hz;gain_db;phase_deg", F, DECIBELS, DEGREES, mark=";"), "f_hz",
                 ("gain_db", "phase_deg")),
    "a ratio and radians": (table("f,|G|,arg(G) [rad]", F, MAGNITUDE, TURN), "f",
                            ("|G|", "arg(G) [rad]")),
    "a gain and degrees": (table("f/Hz,Gain/(V/V),Phase/°", F, MAGNITUDE, DEGREES), "f",
                           ("Gain", "Phase/°")),
    "complex texts": (table("f,G", F, texts("{re}{im:+}j")), "f", "G"),
    "complex texts of MATLAB": (table("f,G", F, texts("{re} {im:+}i")), "f", "G"),
    "complex texts in brackets": (table("f;G", F, texts("({re}{im:+}j)"), mark=";"), "f", "G"),
    "complex texts, i first": (
        table("f,G", F, [f"{z.real}{'+' if z.imag >= 0 else '-'}i*{abs(z.imag)}" for z in G]),
        "f", "G",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("text", "frequency", "response"), FORMS.values(), ids=FORMS)
def test_the_same_response_comes_out(tmp_path, text, frequency, response):
    file = tmp_path / "g.csv"
    file.write_text(text, encoding="utf-8")
    data = read_response(file, frequency, response)
    np.testing.assert_allclose(data["frequency"], F, rtol=1e-12)
    np.testing.assert_allclose(data["response"].values.ravel(), G, rtol=1e-12, atol=1e-14)


def test_what_was_found_is_told(tmp_path):
    file = tmp_path / "g.csv"
    file.write_text(table("f,gain,phase [deg]", F, MAGNITUDE, DEGREES))
    read = read_response(file, "f", ("gain", "phase")).attrs["read"]
    assert "unit of 'f' unknown, taken as Hz" in read
    assert "magnitude 'gain' in 1 (no unit known), phase 'phase' in deg" in read
    file.write_text(table("omega,a,b", F, G.real, G.imag))
    read = read_response(file, "omega", ("a", "b")).attrs["read"]
    assert "unit of 'omega' unknown, taken as rad/s" in read
    assert "'a' and 'b' taken as real and imaginary part" in read


REFUSED = {
    "a phase without unit": (
        table("f,gain,phase", F, MAGNITUDE, TURN), ("gain", "phase"),
        r"unit of phase 'phase' is unknown: call it 'phase \[deg\]' or 'phase \[rad\]'",
    ),
    "a negative ratio": (
        table("f,gain,phase [deg]", F, DECIBELS, DEGREES), ("gain", "phase"),
        r"'gain' is negative: .* call it 'gain \[dB\]'",
    ),
    "a magnitude and a part": (
        table("f,gain,im", F, MAGNITUDE, G.imag), ("gain", "im"), "name two that belong together",
    ),
    "a phase first": (
        table("f,phase [deg],gain", F, DEGREES, MAGNITUDE), ("phase", "gain"),
        "name two that belong together",
    ),
    "a strange phase": (
        table("f,gain,phase [V]", F, MAGNITUDE, TURN), ("gain", "phase [V]"), "cannot be converted",
    ),
    "a word": (table("f,G", F, ["1+2j", "1+x", "2j", "3"]), "G", "line 3: '1.x' is not a complex"),
    "a blank": (table("f,G", F, ["1+2j", "", "2j", "3"]), "G", "'G' has 1 entries .* line 3"),
    "a magnitude alone": (table("f,gain [dB]", F, DECIBELS), "gain", "is a magnitude alone"),
    "three columns": (table("f,a,b", F, F, F), ("a", "b", "f"), "one name or two, not 3"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "response", "said"), REFUSED.values(), ids=REFUSED)
def test_what_is_left_open_is_refused(tmp_path, text, response, said):
    file = tmp_path / "g.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=said):
        read_response(file, "f", response)


def test_a_frequency_twice_is_refused(tmp_path):
    (tmp_path / "g1.csv").write_text(table("f,re,im", F, G.real, G.imag))
    (tmp_path / "g2.csv").write_text(table("f,re,im", [1.0, 2.0, 2.0, 10.0], G.real, G.imag))
    with pytest.raises(InputError, match=r"g2\.csv has the frequency 2 Hz twice"):
        Responses.from_files(str(tmp_path / "g*.csv"), frequency="f", response=("re", "im"))


def test_files_of_one_set_may_differ_in_form(tmp_path):
    (tmp_path / "g1.csv").write_text(table("f_Hz,mag [dB],ph [deg]", F, DECIBELS, DEGREES))
    (tmp_path / "g2.csv").write_text(table("f [kHz],mag [1],ph [rad]", F / 1e3, MAGNITUDE, TURN))
    plants = Responses.from_files(str(tmp_path / "g*.csv"), frequency="f", response=("mag", "ph"))
    assert plants.values.shape == (4, 2)
    np.testing.assert_allclose(plants.values, np.column_stack([G, G]), rtol=1e-12)
