"""Our models of the arm against the best subspace models of a public package,
chosen the same way.
"""

from __future__ import annotations

import contextlib
import io
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from workbench import Check, Run, figures, problem, ref
from workbench.errors import InputError
from workbench.executor import Context
from workbench.identification import Experiments, InnovationsModel, StateSpaceFit
from workbench.identification.state_space.identified import MODELS, USES, IdentifiedModels
from workbench.identification.state_space.question import Fitter
from workbench.identification.state_space.selection import HORIZONS
from workbench.study import Study, check, figure, metric
from workbench.types import Array, DataArray, Dataset, Figure

from ..cd_arm.identification import RECORD, arm_fit

ALGORITHMS = ("N4SID", "MOESP", "CVA", "PARSIM-K")
"""Subspace algorithms of the package. Its PARSIM-S and PARSIM-P give no stable model of this
record.
"""
BLOCK_LENGTH = 50
"""Length [samples] of the blocks of errors; the spread of their means gives the standard error."""


@problem(
    "bench/cd-arm",
    data=f"../cd_arm/{RECORD}",
    needs={"own": ref("cd-arm/identification")},
    slow=True,
)
def peer(own: Run) -> PeerComparison:
    """The models of cd-arm/identification against the best subspace models of sippy_unipi.

    The package's models are chosen among the same horizons and orders as ours, and in the same way:
    by validation within the first 1024 samples, its predictor by the one-step fit and its simulator
    by the free-run fit. The other samples test each model in its use.
    """
    orders = tuple(int(order) for order in own.data["order"].values)
    return PeerComparison(arm_fit(orders), own.answer)


@dataclass(frozen=True, eq=False)
class PeerComparison(Study):
    """Fits on held-out data of our models and of the package's, each in its own use."""

    program: StateSpaceFit
    own: IdentifiedModels

    headline: ClassVar[str] = "least_advantage"

    @property
    def quantifier(self) -> str:
        return "on these records"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        program, orders = self.program, tuple(self.program.orders or ())
        outputs = program.record.y.shape[1]
        scores = np.empty((len(ALGORITHMS), len(HORIZONS), len(orders), len(USES), outputs))
        for place in context.track(list(np.ndindex(scores.shape[:3])), "sippy_unipi"):
            scores[place] = program.validate(self._fitter(place))
        chosen = [self._best(means) for means in np.moveaxis(scores.mean(axis=-1), -1, 0)]
        labels = [
            f"{ALGORITHMS[i]}, horizon {HORIZONS[j]}, order {orders[k]}" for (i, j, k), _ in chosen
        ]
        pairs = ((self.own.predictor, self.own.simulator), (chosen[0][1], chosen[1][1]))
        held_out = [
            program.fits(*pair, program.judged_record.u, program.judged_record.y) for pair in pairs
        ]
        return xr.Dataset(
            {
                "validation_fit": (
                    ("algorithm", "horizon", "order", "use", "output"),
                    scores,
                    {"units": "%"},
                ),
                "fit": (
                    ("package", "use", "output"),
                    held_out,
                    {"units": "%", "long_name": "fit on held-out data"},
                ),
                "package_ahead": (
                    ("use", "output"),
                    self._excess_in_deviations(*pairs),
                    {"units": "standard errors"},
                ),
                "chosen_order": (
                    ("package", "use"),
                    [[model.order for model in pair] for pair in pairs],
                ),
            },
            coords={
                "algorithm": list(ALGORITHMS),
                "horizon": list(HORIZONS),
                "order": list(orders),
                "use": list(USES),
                "output": [f"y{n + 1}" for n in range(outputs)],
                "package": ["workbench", "sippy_unipi"],
            },
            attrs=dict(zip(MODELS, labels, strict=True)),
        )

    def _fitter(self, place: tuple[int, ...]) -> Fitter:
        """The fitting function at a place (algorithm, horizon, order)."""
        algorithm, horizon, order = place
        return fit(
            ALGORITHMS[algorithm], HORIZONS[horizon], tuple(self.program.orders or ())[order]
        )

    def _best(self, means: Array) -> tuple[tuple[int, ...], InnovationsModel]:
        """Place (algorithm, horizon, order) of the best mean fit, and its model.

        Places are skipped if the package has no stable model of the whole estimation part there.
        """
        for at in np.argsort(-means, axis=None, kind="stable"):
            place = tuple(int(i) for i in np.unravel_index(int(at), means.shape))
            model = self._fitter(place)(self.program.estimation_record)
            if model is not None and np.isfinite(means[place]):
                return place, model
        raise InputError("the package gave no stable model of the whole estimation part")

    def _excess_in_deviations(
        self,
        own: tuple[InnovationsModel, InnovationsModel],
        theirs: tuple[InnovationsModel, InnovationsModel],
    ) -> Array:
        """Mean excess (uses, ny) of our squared errors over the package's, in standard errors.

        The standard error comes from the means of blocks, which are longer than the errors are
        correlated.
        """
        program, washout = self.program, self.program.washout_samples
        u, y = program.judged_record.u, program.judged_record.y
        rows = []
        for use, *models in zip(USES, own, theirs, strict=True):
            ours, other = ((y - getattr(model, use)(u, y, washout))[washout:] for model in models)
            difference = ours**2 - other**2
            count = len(difference) // BLOCK_LENGTH
            blocks = (
                difference[: count * BLOCK_LENGTH].reshape(count, BLOCK_LENGTH, -1).mean(axis=1)
            )
            rows.append(blocks.mean(axis=0) / (blocks.std(axis=0, ddof=1) / np.sqrt(count)))
        return np.array(rows)

    @check()
    def reached(self, fit: DataArray) -> list[Check]:
        statement = "the package's fit on held-out data [%], which ours must reach"
        pairs = fit.stack(pair=("use", "output")).transpose("pair", "package")
        return [
            Check(f"{use.replace('_', ' ')} of {output}", statement, float(theirs), float(ours))
            for (use, output), (ours, theirs) in zip(
                pairs["pair"].values, pairs.values, strict=True
            )
        ]

    fits = metric("{package}_fit_{use}_{output}", value=lambda fit: fit)
    orders = metric(
        template="{package}_order",
        value=lambda chosen_order: chosen_order.sel(use="one_step", drop=True),
    )
    orders_free_run = metric(
        template="{package}_order_free_run",
        value=lambda chosen_order: chosen_order.sel(use="free_run", drop=True),
    )
    ahead = metric(
        template="package_ahead_{use}_{output}_standard_errors",
        value=lambda package_ahead: package_ahead,
    )
    least_advantage = metric(
        template=lambda fit: (fit.sel(package="workbench") - fit.sel(package="sippy_unipi")).min()
    )

    @figure
    def bars(self, answer: Dataset) -> dict[str, Figure]:
        fit = answer["fit"].stack(bar=("use", "output"))
        figure, (panel,) = figures.axes(1, 1, size=(7.0, 3.8))
        place = np.arange(fit["bar"].size)
        for shift, package in ((-0.18, "workbench"), (0.18, "sippy_unipi")):
            bars = panel.bar(place + shift, fit.sel(package=package), 0.32, label=package)
            panel.bar_label(bars, fmt="%.1f", fontsize=8)
        labels = [f"{use.replace('_', ' ')}, {output}" for use, output in fit["bar"].values]
        panel.set_xticks(place, labels)
        figures.label(panel, y="fit on held-out data [%]")
        lines = [f"{name} of sippy_unipi: {answer.attrs[name]}" for name in MODELS]
        panel.set_title("\n".join(lines), fontsize=9)
        figures.legend_below(figure, panel)
        return {"fits": figure}


def fit(algorithm: str, horizon: int, order: int) -> Fitter:
    """A fitting function by one subspace algorithm of the package; it returns None if
    that fails.
    """
    try:
        from sippy_unipi import system_identification
    except ModuleNotFoundError:
        raise InputError(
            "bench/cd-arm needs sippy_unipi: pip install 'robust-workbench[benchmark]'"
        ) from None

    def fitted(record: Experiments) -> InnovationsModel | None:
        u, y = record.u, record.y
        u_offset, y_offset = u.mean(axis=0), y.mean(axis=0)
        try:
            with contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore"):
                system = system_identification(
                    (y - y_offset).T,
                    (u - u_offset).T,
                    algorithm,
                    SS_f=horizon,
                    SS_p=horizon,
                    SS_fixed_order=order,
                    SS_D_required=True,
                )
        except (ArithmeticError, ValueError, np.linalg.LinAlgError):
            return None
        if np.shape(system.K) != (len(system.A), y.shape[1]):
            return None  # no Kalman gain was found
        if len(system.A) != order:
            return None  # the package quietly lowers an order above its horizon
        model = InnovationsModel(
            system.A, system.B, system.C, system.D, system.K, u_offset, y_offset
        )
        return model if max(model.radius, model.predictor_radius) < 1 else None

    return fitted
