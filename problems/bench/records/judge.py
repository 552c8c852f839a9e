"""Compare our models of public records with those of other packages, on held-back halves.

    python -m problems.bench.records.judge FOLDER --part develop     # first halves alone
    python -m problems.bench.records.judge FOLDER --part judged      # second halves, once

Every package estimates on the first half of a record. Its algorithms, orders and lags give its
candidates. For one-step predictions and for simulations it takes the candidate that validates best
within the first half, on the same folds as ours, and fits it to the whole half. The second half
then tests both once. With ``--part develop`` the first half is cut in half again instead, so that
no second half is seen. Each record makes one file of rows in the folder of results; records that
have a file are skipped.
"""

from __future__ import annotations

import argparse
import csv
import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from workbench import solve
from workbench.errors import InputError
from workbench.identification import Experiments, StateSpaceFit
from workbench.identification.state_space.folds import VALIDATION_SHARE, scored_fit
from workbench.identification.state_space.identified import USES
from workbench.types import RealArray

from .catalogue import RECORDS, PublicRecord
from .linear_peers import Fitting, nfoursid, sippy, statsmodels
from .narx_peer import sysidentpy
from .reading import question, read_halves

PEERS: dict[str, Callable[[int, int, int], Iterator[tuple[str, Fitting]]]] = {
    "sippy_unipi": sippy,
    "nfoursid": nfoursid,
    "statsmodels": statsmodels,
    "SysIdentPy, linear": partial(sysidentpy, linear=True),
    "SysIdentPy, nonlinear": partial(sysidentpy, linear=False),
}
METHOD = "averaged"
"""Our method that is judged."""
PATIENCE = 300.0
"""Time [s] after which a package gets no more candidates for a record."""
WORST_OWN_FIT = -100.0
"""Fit [%] on its own half below which a package's model is skipped, because it diverges."""
FIELDS = ("record", "package", "use", "output", "fit", "model", "seconds")


def ours(program: StateSpaceFit) -> Iterator[tuple[str, RealArray, str, float]]:
    """Use, fits (ny,) [%], description of the model and seconds, for our method."""
    start = time.perf_counter()
    solution = solve(program, method=METHOD)
    seconds = time.perf_counter() - start
    answer = solution.answer
    if answer is None or answer.candidates is None:
        raise RuntimeError(f"{program.title}: {solution.message}")
    fits = program.fits(
        answer.predictor, answer.simulator, program.judged_record.u, program.judged_record.y
    )
    for use, row in enumerate(fits):
        yield USES[use], row, answer.candidates.words(use, USES[use]), seconds


def theirs(program: StateSpaceFit, package: str) -> Iterator[tuple[str, RealArray, str, float]]:
    """Use, fits (ny,) [%], description of the model and seconds, for a package's best
    candidates.
    """
    start = time.perf_counter()
    used = program.estimation_record
    nu, ny = used.u.shape[1], used.y.shape[1]
    ways = dict(PEERS[package](nu, ny, len(used)))
    scores: dict[str, RealArray] = {}
    for label, fit in ways.items():
        if time.perf_counter() - start > PATIENCE:
            break
        scores[label] = _validation_fits(program, fit)
    for place, use in enumerate(USES):
        ranked = sorted(scores, key=lambda label: -scores[label][place])
        for label in ranked:
            if np.isfinite(scores[label][place]):
                model = tried(ways[label], used)
                fits = _scores(program, model, program.judged_record)[place]
                own = _scores(program, model, used)[place].mean()
                if np.isfinite(fits).all() and own > WORST_OWN_FIT:
                    yield use, fits, label, time.perf_counter() - start
                    break
        else:
            yield use, np.full(ny, np.nan), "no model", time.perf_counter() - start


def _validation_fits(program: StateSpaceFit, fit: Fitting) -> RealArray:
    """Mean validation fits (uses,) over outputs and folds; minus infinity without a model."""
    total = np.zeros(len(USES))
    folds = program.folds or [_last_third_held_back(program.estimation_record)]
    for used, left in folds:
        total += _scores(program, tried(fit, used), left).mean(axis=1) / len(folds)
    return np.where(np.isfinite(total), total, -np.inf)


def _last_third_held_back(record: Experiments) -> tuple[Experiments, Experiments]:
    """A fold for records without folds of ours, which need inputs that move."""
    cut = round(len(record) * (1 - VALIDATION_SHARE))
    return record.part(0, cut), record.part(cut, len(record))


def tried(fit: Fitting, record: Experiments) -> object | None:
    """The model of a package on a record, without its warnings; None if the package raises an
    error.
    """
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            return fit(record)
        except Exception:  # packages raise all kinds of errors
            return None


def _scores(program: StateSpaceFit, model: object | None, record: Experiments) -> RealArray:
    """Fits (uses, ny) [%] on a record; minus infinity where there is no model."""
    found = np.full((len(USES), record.y.shape[1]), -np.inf)
    for place, use in enumerate(USES):
        run = getattr(model, use, None)
        if run is not None:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                try:
                    fits = scored_fit(run, record, program.washout_samples)
                except (ArithmeticError, ValueError, np.linalg.LinAlgError):
                    continue
            found[place] = np.where(np.isfinite(fits), fits, -np.inf)
    return found


def rows_of(
    record: PublicRecord, folder: Path, part: str, packages: list[str]
) -> Iterator[dict[str, str]]:
    """Rows of the file of results for one record."""
    first, second = read_halves(record, folder)
    if part == "develop":
        first, second = first.halved()
    program = question(first, second, record.name, record.sample_time)
    for package in packages:
        found = ours(program) if package == "workbench" else theirs(program, package)
        for use, fits, model, seconds in found:
            for o, fit in enumerate(fits):
                values = (record.name, package, use, f"y{o + 1}", f"{fit:.4f}", model)
                yield dict(zip(FIELDS, (*values, f"{seconds:.1f}"), strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="your copies of the records")
    parser.add_argument("--part", choices=("develop", "judged"), required=True)
    parser.add_argument("--results", type=Path, default=Path("records"))
    parser.add_argument("--records", nargs="*", default=[record.name for record in RECORDS])
    parser.add_argument("--packages", nargs="*", default=["workbench", *PEERS])
    given = parser.parse_args()
    for record in RECORDS:
        path = given.results / given.part / f"{record.name}.csv"
        if record.name not in given.records or path.exists():
            continue
        try:
            rows = list(rows_of(record, given.folder, given.part, given.packages))
        except InputError as error:
            print(f"{record.name} is left out: {error}", flush=True)
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, FIELDS)
            writer.writeheader()
            writer.writerows(rows)
        for row in rows:
            print(*row.values(), sep="  ", flush=True)


if __name__ == "__main__":
    main()
