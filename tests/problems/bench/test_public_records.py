"""Public records: their files are read from a user's folder, and packages are judged alike."""

import csv

import numpy as np
import pytest
from scipy.io import savemat
from scipy.signal import lfilter
from workbench.plants.bench.records import judge
from workbench.plants.bench.records.catalogue import RECORDS, PublicRecord, Section
from workbench.plants.bench.records.reading import read_halves
from workbench.plants.bench.records.summary import (
    Cell,
    cells,
    duels,
    fits_table,
    standings,
    verdict,
)

from workbench.errors import InputError


def signals(samples=400, seed=0):
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal(samples), 0.2 * rng.standard_normal(samples)
    return u, lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u) + lfilter([1.0], [1.0, -1.5, 0.7], e)


def made(name, *sections, longest=None):
    return PublicRecord(name, "made", 1.0, sections, "none", longest=longest)


def test_the_catalogue_is_long_enough_and_says_whose_each_record_is():
    names = [record.name for record in RECORDS]
    assert len(set(names)) == len(names) >= 14
    assert all(record.citation and record.terms and record.about for record in RECORDS)
    assert sum(record.source == "DaISy" for record in RECORDS) >= 14


def test_text_csv_and_matlab_files_are_halved_or_come_in_halves(tmp_path):
    u, y = signals()
    np.savetxt(tmp_path / "a.dat", np.column_stack([np.arange(400), u, y]))
    text = made("a", Section("a.dat", (1,), (2,)), longest=300)
    first, second = read_halves(text, tmp_path)
    np.testing.assert_allclose(first.u[:, 0], u[:150])
    np.testing.assert_allclose(second.y[:, 0], y[150:300])
    rows = "\n".join(f"{a},{b}," for a, b in zip(u, y, strict=True))
    (tmp_path / "b.csv").write_text(f"u, y,\n{rows}\n")
    savemat(tmp_path / "c.mat", {"u": u[None], "p": y[None]})
    pair = made("b", Section("b.csv", ("u",), ("y",)), Section("c.mat", ("u",), ("p",)))
    for half in read_halves(pair, tmp_path):
        np.testing.assert_allclose(half.u[:, 0], u)
        np.testing.assert_allclose(half.y[:, 0], y)


def test_what_is_missing_is_named(tmp_path):
    with pytest.raises(InputError, match=r"ballbeam needs your copy of ballbeam\.dat"):
        read_halves(RECORDS[0], tmp_path)
    np.savetxt(tmp_path / "a.dat", np.zeros((10, 2)))
    with pytest.raises(InputError, match="no column"):
        read_halves(made("a", Section("a.dat", (0,), (2,))), tmp_path)


def judged(tmp_path, part, packages):
    u, y = signals()
    np.savetxt(tmp_path / "a.dat", np.column_stack([u, y]))
    record = made("a", Section("a.dat", (0,), (1,)))
    return list(judge.rows_of(record, tmp_path, part, packages))


def test_a_package_is_judged_on_the_second_half_alone(tmp_path, monkeypatch):
    """What validates best in the first half is taken, however well another would have done."""

    def candidates(nu, ny, samples):
        assert (nu, ny, samples) == (1, 1, 200)
        yield "good", lambda record: Known(1.0, record)
        yield "bad", lambda record: Known(0.0, record)
        yield "raises", lambda record: 1 / 0

    monkeypatch.setitem(judge.PEERS, "made", candidates)
    rows = judged(tmp_path, "judged", ["made"])
    assert [row["use"] for row in rows] == ["one_step", "free_run"]
    assert {row["model"] for row in rows} == {"good"}
    _, y = signals()
    held_back = y[200 + 22 :]  # the washout is a third of the shortest part
    expected = 100 * (1 - np.linalg.norm(0.1 * np.ones(178)) / np.linalg.norm(_moved(held_back)))
    assert float(rows[0]["fit"]) == pytest.approx(expected, abs=1e-3)


class Known:
    """A model that knows the outputs, or nothing."""

    def __init__(self, share, record):
        self.share = share

    def one_step(self, u, y, washout):
        return self.share * y + 0.1

    free_run = one_step


def _moved(y):
    return y - y.mean()


def test_development_sees_no_second_half(tmp_path, monkeypatch):
    seen = []

    def candidates(nu, ny, samples):
        yield "one", lambda record: seen.append(record.y) or Known(1.0, record)

    monkeypatch.setitem(judge.PEERS, "made", candidates)
    judged(tmp_path, "develop", ["made"])
    _, y = signals()
    assert all(np.isin(part[:, 0], y[:100]).all() for part in seen)


@pytest.mark.slow
@pytest.mark.parametrize("package", ["sippy_unipi", "statsmodels", "nfoursid"])
def test_the_models_of_a_package_predict_what_it_predicts(package):
    """With candidates of its own, every package finds a good model of a good record."""
    pytest.importorskip(package)
    from workbench.identification import Experiments

    u, y = signals(600, seed=1)
    record = Experiments(u[:, None], 3 + 2 * y[:, None])
    fits = {}
    for label, fit in judge.PEERS[package](1, 1, 600):
        model = judge.tried(fit, record)
        if model is not None:
            error = (record.y - model.one_step(record.u, record.y, 50))[50:]
            fits[label] = float(np.std(error)) / 0.4
    assert 0.8 < min(fits.values()) < 1.1


def test_a_summary_counts_cells_that_are_level(tmp_path):
    fields = {"record": "a", "output": "y1", "model": "m", "seconds": 1.0}
    fits = {
        "workbench": (80.0, 50.0),
        "sippy_unipi": (80.4, 53.0),
        "SysIdentPy, nonlinear": (90, 9),
    }
    with (tmp_path / "a.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, judge.FIELDS)
        writer.writeheader()
        for package, pair in fits.items():
            for use, fit in zip(("one_step", "free_run"), pair, strict=True):
                writer.writerow(fields | {"package": package, "use": use, "fit": fit})
    found = cells(tmp_path)
    assert found[0] == Cell("a", "one_step", {k: float(v[0]) for k, v in fits.items()})
    assert "in 1 of 2 (50 %); more than 2 points below in 1; worst -3.00 (a, free run)" in verdict(
        found, nonlinear=False
    )
    assert "worst -10.00 (a, one step)" in verdict(found, nonlinear=True)
    assert "80.00" in fits_table(found) and "-10.00" in fits_table(found)
    with pytest.raises(InputError, match="no results"):
        cells(tmp_path / "none")


def test_every_package_is_measured_alike():
    """Against the best of the others; a package without a model counts as far below."""
    fits = {"workbench": 80.0, "sippy_unipi": 80.4, "nfoursid": 70.0}
    found = [
        Cell("a", "one_step", fits),
        Cell("a", "free_run", fits | {"workbench": 90.0, "nfoursid": float("nan")}),
    ]
    assert found[0].ahead(True, "sippy_unipi") == pytest.approx(0.4)
    assert found[1].ahead(True, "nfoursid") == -np.inf
    rows = {row.split("|")[1].strip(): row for row in standings(found).splitlines()[2:]}
    cut = {name: [cell.strip() for cell in row.split("|")[2:7]] for name, row in rows.items()}
    assert cut["workbench"] == ["100 %", "0", "+4.60", "-0.40 (a, one step)", "0"]
    assert cut["sippy_unipi"] == ["50 %", "1", "-4.60", "-9.60 (a, free run)", "0"]
    assert cut["nfoursid"] == ["0 %", "2", "-inf", "-10.40 (a, one step)", "1"]


def test_ours_is_set_beside_each_package_by_itself():
    """Level or ahead by use; a cell without the package's model is won, and has no distance."""
    fits = {"workbench": 80.0, "sippy_unipi": 80.4, "nfoursid": 90.0}
    found = [Cell("a", "one_step", fits), Cell("a", "free_run", fits | {"nfoursid": float("nan")})]
    rows = [[cell.strip() for cell in row.split("|")[1:-1]] for row in duels(found).splitlines()]
    assert rows[2] == [
        "sippy_unipi", "100 %", "100 %", "100 %", "0", "-0.40", "-0.40 (a, one step)",
    ]  # fmt: skip
    assert rows[3] == [
        "nfoursid", "0 %", "100 %", "50 %", "1", "-10.00", "-10.00 (a, one step)",
    ]  # fmt: skip
