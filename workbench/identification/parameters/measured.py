"""Data of a parameter fit: measured responses and records, each with its model.

A model is a Python function. It is called with numbers for the checks, and with CasADi's symbols
for exact derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any, Protocol

import numpy as np

from workbench.errors import InputError
from workbench.identification.experiments.quality import as_record
from workbench.identification.experiments.reports import report_of_arrays
from workbench.identification.parameters.complex_pair import ComplexPair
from workbench.identification.record_tests.report import RecordReport
from workbench.identification.responses.periodic import ResponseEstimate

ParameterValues = Mapping[str, Any]
"""Parameters by name, as numbers or as symbols."""


class Measured(Protocol):
    """Interface of data with a model; see `MeasuredResponse` for the members."""

    @property
    def name(self) -> str: ...
    @property
    def degrees(self) -> float: ...
    @property
    def weighted(self) -> bool: ...
    @property
    def count(self) -> int: ...
    @property
    def size(self) -> float: ...
    def residuals(self, values: Mapping[str, float]) -> np.ndarray: ...
    def expression(self, names: Sequence[str], vector: Any) -> Any: ...


@dataclass(frozen=True, eq=False)
class MeasuredResponse:
    """A measured frequency response with its model ``model(p, s)``.

    Unlike a `ResponseEstimate`, it belongs to a model whose parameters are fitted to several
    responses.

    Parameters
    ----------
    model
        Function of the parameters by name and of s = j omega [rad/s]; returns the response, or
        nested lists (a list of inputs for each output). It may use arithmetic, powers and NumPy's
        exp, log and sqrt: a delay is ``np.exp(-s * p["delay"])``.
    frequency_hz
        Frequencies [Hz], shape (F,).
    response
        Complex, shape (F,) or (F, outputs, inputs).
    variance
        E|error|^2 of each entry, real and imaginary part together; None: it is equal everywhere,
        and is estimated from the residuals.
    degrees
        Degrees of freedom of the variance if it is an estimate: 2 (M - 1) for M periods.
    name
        Name in messages and figures.
    report
        Report of the record from which it was estimated, if there is one.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import FittedParameter, MeasuredResponse
    >>> frequency = np.geomspace(0.1, 10, 20)
    >>> exact = 3.0 / (2j * np.pi * frequency + 2.0)
    >>> measured = MeasuredResponse(
    ...     lambda p, s: p["k"] / (s + p["a"]), frequency, exact, variance=np.full(20, 1e-6)
    ... )
    >>> start = {"k": FittedParameter(1.0), "a": FittedParameter(1.0, lower=0.1)}
    >>> residuals = measured.residuals({"k": 3.0, "a": 2.0})
    >>> bool(abs(residuals).max() < 1e-9)
    True
    """

    model: Callable[[ParameterValues, Any], Any]
    frequency_hz: Any
    response: Any
    _: KW_ONLY
    variance: Any = None
    degrees: float = np.inf
    name: str = "response"
    report: RecordReport | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        frequency = as_record(self.frequency_hz, name=f"frequency of {self.name}")
        response = np.asarray(self.response, dtype=complex)
        if response.shape[:1] != frequency.shape or response.ndim not in (1, 3):
            raise InputError(
                f"{self.name} needs shape ({len(frequency)},) or ({len(frequency)}, outputs, "
                f"inputs), not {response.shape}"
            )
        wrong = ~np.isfinite(response).reshape(len(frequency), -1).all(axis=1)
        if wrong.any():
            raise InputError(f"{self.name} is not finite at {frequency[np.argmax(wrong)]:g} Hz")
        _set(self, frequency_hz=frequency, response=response)
        _set(self, variance=_variance(self.variance, response.shape, self.name))
        if not self.degrees > 4:
            raise InputError(
                f"the variance of {self.name} has {self.degrees:g} degrees of freedom: its weights "
                "are useless below 6; measure four periods or more"
            )

    @classmethod
    def of(
        cls,
        model: Callable[[ParameterValues, Any], Any],
        estimate: ResponseEstimate,
        *,
        name: str = "response",
    ) -> MeasuredResponse:
        """Measured response from an estimate with its variance, with a model."""
        values, variance = estimate.response, estimate.variance
        if values.shape[1:] == (1, 1):
            values, variance = values[:, 0, 0], variance[:, 0, 0]
        return cls(
            model,
            estimate.frequency_hz,
            values,
            variance=variance,
            degrees=estimate.degrees,
            name=name,
            report=estimate.report,
        )

    @property
    def weighted(self) -> bool:
        """Whether the variance is given."""
        return self.variance is not None

    @property
    def count(self) -> int:
        """Number of real data."""
        return 2 * self.response.size

    @property
    def weights(self) -> np.ndarray:
        """Inverse standard deviation (F, entries) of the real, and of the imaginary part."""
        entries = self.response.reshape(len(self.response), -1)
        if self.variance is None:
            return np.ones(entries.shape)
        return np.sqrt(2 / self.variance.reshape(entries.shape))

    @property
    def size(self) -> float:
        """Norm of the data in units of their standard deviation."""
        return float(np.linalg.norm(self.response.reshape(self.weights.shape) * self.weights))

    def predicted(self, values: ParameterValues) -> np.ndarray:
        """Response of the model, in the shape of the measured one."""
        s = 2j * np.pi * self.frequency_hz
        entries = list(_entries(self.model(values, s)))
        if len(entries) * len(s) != self.response.size:
            raise InputError(
                f"the model of {self.name} gives {len(entries)} entries, the data have "
                f"{self.response.size // len(s)}"
            )
        columns = [np.broadcast_to(np.asarray(e, dtype=complex), s.shape) for e in entries]
        return np.stack(columns, axis=1).reshape(self.response.shape)

    def residuals(self, values: Mapping[str, float]) -> np.ndarray:
        """Model minus data, in units of the standard deviation, real parts first."""
        error = (self.predicted(values) - self.response).reshape(self.weights.shape) * self.weights
        return np.concatenate([error.real.ravel(), error.imag.ravel()])

    def expression(self, names: Sequence[str], vector: Any) -> Any:
        """Residuals as a CasADi expression of the parameters in ``vector``.

        Their order is different.
        """
        import casadi as ca

        p, omega = ca.SX.sym("p", len(names)), ca.SX.sym("omega")
        pairs = {name: ComplexPair(p[i]) for i, name in enumerate(names)}
        entries = [ComplexPair.of(e) for e in _entries(self.model(pairs, ComplexPair(0.0, omega)))]
        parts = ca.vertcat(*(e.real for e in entries), *(e.imag for e in entries))
        count = len(self.frequency_hz)
        every = ca.Function("response", [p, omega], [parts]).map(count)
        model = every(ca.repmat(vector, 1, count), ca.DM(2 * np.pi * self.frequency_hz).T)
        data = self.response.reshape(count, -1)
        weights = np.hstack([self.weights, self.weights])
        return ca.vec((model - ca.DM(np.hstack([data.real, data.imag]).T)) * ca.DM(weights.T))


@dataclass(frozen=True, eq=False)
class MeasuredRecord:
    """A measured record with the model ``step(p, x, u)`` that simulates it.

    Parameters
    ----------
    step
        Function of the parameters by name, the list of states and the list of inputs at one sample;
        it returns the list of states at the next sample and the list of outputs at this one. It may
        use arithmetic and CasADi's functions.
    initial
        Function of the parameters; returns the list of states at the first sample.
    u
        Inputs, shape (inputs, N).
    y
        Outputs, shape (outputs, N).
    variance
        Variance of each output's white noise, shape (outputs,); None has the same meaning as for
        `MeasuredResponse`.
    name
        Name in messages and figures.
    assume
        Assumptions about the record that you vouch for although its `record_report` rejects them.

    Raises
    ------
    InputError
        Records of different lengths, values that are not finite, or a finding that forbids the use
        of the record, such as feedback from y to u: a simulation assumes that u is independent of
        the noise.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import FittedParameter, MeasuredRecord, fit_parameters
    >>> u = np.sign(np.sin(np.arange(60.0)))
    >>> y = [0.0]
    >>> for k in range(59):
    ...     y.append(0.8 * y[-1] + u[k])
    ...
    >>> record = MeasuredRecord(
    ...     lambda p, x, u: ([p["a"] * x[0] + u[0]], [x[0]]),
    ...     lambda p: [0.0],
    ...     u[None],
    ...     np.array(y)[None],
    ...     variance=[1e-6],
    ... )
    >>> round(fit_parameters(record, {"a": FittedParameter(0.5)}).values["a"], 4)
    0.8
    """

    step: Callable[
        [ParameterValues, Sequence[Any], Sequence[Any]], tuple[Sequence[Any], Sequence[Any]]
    ]
    initial: Callable[[ParameterValues], Sequence[Any]]
    u: Any
    y: Any
    _: KW_ONLY
    variance: Any = None
    name: str = "record"
    assume: str | Sequence[str] = field(default=(), kw_only=True)
    report: RecordReport = field(init=False)

    def __post_init__(self) -> None:
        u = np.atleast_2d(as_record(self.u, name=f"u of {self.name}"))
        y = np.atleast_2d(as_record(self.y, name=f"y of {self.name}"))
        if u.shape[1] != y.shape[1]:
            raise InputError(f"{self.name}: u has {u.shape[1]} samples, y has {y.shape[1]}")
        _set(self, u=u, y=y, variance=_variance(self.variance, y.shape[:1], self.name))
        _set(self, report=report_of_arrays(u.T, y.T, self.assume, name=self.name))

    @property
    def degrees(self) -> float:
        """Degrees of freedom of the variance, which is taken as exact."""
        return np.inf

    @property
    def weighted(self) -> bool:
        """Whether the variance is given."""
        return self.variance is not None

    @property
    def count(self) -> int:
        """Number of real data."""
        return self.y.size

    @property
    def weights(self) -> np.ndarray:
        """Inverse standard deviation (outputs, 1) of each output."""
        outputs = len(self.y)
        return np.ones((outputs, 1)) if self.variance is None else self.variance[:, None] ** -0.5

    @property
    def size(self) -> float:
        """Norm of the data in units of their standard deviation."""
        return float(np.linalg.norm(self.y * self.weights))

    def predicted(self, values: ParameterValues) -> np.ndarray:
        """Simulated outputs, shape (outputs, N)."""
        state: Sequence[Any] = list(self.initial(values))
        outputs = []
        for inputs in self.u.T:
            state, output = self.step(values, state, list(inputs))
            outputs.append(output)
        return np.array(outputs, dtype=float).T

    def residuals(self, values: Mapping[str, float]) -> np.ndarray:
        """Simulation minus data, in units of the standard deviation."""
        return ((self.predicted(values) - self.y) * self.weights).ravel()

    def expression(self, names: Sequence[str], vector: Any) -> Any:
        """Residuals as a CasADi expression of the parameters in ``vector``.

        Their order is different.
        """
        import casadi as ca

        p, u = ca.SX.sym("p", len(names)), ca.SX.sym("u", len(self.u))
        values = {name: p[i] for i, name in enumerate(names)}
        first = ca.vertcat(*self.initial(values))
        x = ca.SX.sym("x", first.numel())
        state, output = self.step(values, ca.vertsplit(x), ca.vertsplit(u))
        one = ca.Function("step", [x, p, u], [ca.vertcat(*state), ca.vertcat(*output)])
        samples = self.u.shape[1]
        start = ca.Function("initial", [p], [first])(vector)
        simulated = one.mapaccum(samples)(start, ca.repmat(vector, 1, samples), ca.DM(self.u))[1]
        return ca.vec((simulated - ca.DM(self.y)) * ca.DM(np.tile(self.weights, (1, samples))))


def _entries(value: Any) -> Iterator[Any]:
    """Entries of nested lists, row by row."""
    if isinstance(value, list | tuple):
        for part in value:
            yield from _entries(part)
    else:
        yield value


def _variance(value: Any, shape: tuple[int, ...], name: str) -> np.ndarray | None:
    """The variance as an array of this shape; None for None; raises `InputError` otherwise."""
    if value is None:
        return None
    variance = np.asarray(value, dtype=float)
    if variance.ndim and variance.shape != shape:
        raise InputError(f"the variance of {name} needs shape {shape}, not {variance.shape}")
    if not np.all((variance > 0) & np.isfinite(variance)):
        raise InputError(
            f"the variance of {name} must be positive and finite everywhere; leave it out where "
            "the noise is not known"
        )
    return np.broadcast_to(variance, shape)


def _set(instance: Any, **values: Any) -> None:
    """Set fields of a frozen dataclass during its construction."""
    for name, value in values.items():
        object.__setattr__(instance, name, value)
