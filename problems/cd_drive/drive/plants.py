"""The positioning loops of the twelve CD drives in the laboratory (section 3.7).

From the controller's output u [V] to the normalised error f_en [units], equation 3.18:

    f_en / u = K_total * num / den * w_a / (s + w_a),    K_total = K_at K_amp K_optn.

As printed, without the sign of eq. 3.16: the loop is closed with negative feedback.
Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from workbench.errors import InputError
from workbench.types import ComplexArray, RealArray, StateSpace, TransferFunction

from .actuator import checked_frequency, specific_model, stack
from .tables import ActuatorParameters, Axis, Values, check_axis, drives, nominal_table

Gain = Literal["own", "equal", "agc"]
GAIN_VARIANTS: tuple[Gain, ...] = get_args(Gain)

ATTENUATION = 10 ** (-54 / 20)
"""K_at: attenuator between the computer and the drive (section 3.6)."""
AMPLIFICATION = 10 ** (40 / 20)
"""K_amp: amplifier of the control signals (section 3.6)."""
ANTIALIASING = 2 * math.pi * 8000.0
"""w_a [rad/s]: corner of the first-order anti-aliasing filter (section 3.6)."""


def nominal_parameters(axis: Axis) -> ActuatorParameters:
    """The nominal actuator: the printed values of Table 5.2."""
    table = nominal_table(axis)
    return ActuatorParameters(**{name: table[name].nominal for name in table if name != "K_total"})


def total_gain(axis: Axis) -> float:
    """K_total [units/V]: DC_gain of Table 5.2, which multiplies num/den of Table 3.2."""
    return nominal_table(axis)["K_total"].nominal


def plant(parameters: ActuatorParameters, K_total: float, antialiasing: bool = True) -> StateSpace:
    """Equation 3.18: u [V] -> f_en [units], with or without the anti-aliasing filter."""
    import control

    system = K_total * specific_model(parameters).state_space()
    if antialiasing:
        system = control.ss(-ANTIALIASING, ANTIALIASING, 1.0, 0.0) * system
    return control.ss(system, inputs="u", outputs="f_en")


def responses(
    axis: Axis,
    frequency: ArrayLike,
    gain: Gain = "own",
    values: Values = "printed",
    antialiasing: bool = True,
) -> ComplexArray:
    """f_en/u [units/V] of the twelve drives (eq. 3.18) at `frequency` [Hz] (F,): (12, F).

    gain    "own": K_total in proportion to each drive's K_optn; the midrange has the nominal one;
            "equal": the nominal K_total for all drives;
            "agc": as after automatic gain control, which gives all drives the nominal plant's
            magnitude at the nominal loop's crossover (section 4.4).
    values  "printed" or "corrected" entries of Tables A.1-A.2.

    Raises InputError for unknown choices and for frequencies that are not positive, finite and 1-D.
    """
    twelve = drives(axis, values)
    K_optn = [drive.K_optn for drive in twelve]
    return responses_of(axis, twelve, K_optn, frequency, gain, antialiasing)


def responses_of(
    axis: Axis,
    actuators: Sequence[ActuatorParameters],
    K_optn: Sequence[float],
    frequency: ArrayLike,
    gain: Gain = "own",
    antialiasing: bool = True,
) -> ComplexArray:
    """f_en/u [units/V] (N, F) of any N drives with their K_optn [units/m], computed as in
    `responses`.
    """
    models = stack([specific_model(each) for each in actuators])
    K_total = total_gains(axis, actuators, K_optn, gain)
    return K_total[:, None] * models.response(frequency) * _filter(frequency, antialiasing)


def systems_of(
    axis: Axis,
    actuators: Sequence[ActuatorParameters],
    K_optn: Sequence[float],
    gain: Gain = "own",
    antialiasing: bool = True,
) -> list[StateSpace]:
    """Systems u [V] -> f_en [units] of any N drives; their responses are `responses_of`."""
    K_total = total_gains(axis, actuators, K_optn, gain)
    return [plant(one, float(K), antialiasing) for one, K in zip(actuators, K_total, strict=True)]


def total_gains(
    axis: Axis, actuators: Sequence[ActuatorParameters], K_optn: Sequence[float], gain: Gain = "own"
) -> RealArray:
    """K_total [units/V] (N,) of any N drives, with `gain` as in `responses`."""
    if gain not in get_args(Gain):
        raise InputError(f'gain is {gain!r}; it must be "own", "equal" or "agc"')
    K_total = np.full(len(actuators), total_gain(axis))
    if gain == "own":
        K_total *= np.asarray(K_optn) / ((min(K_optn) + max(K_optn)) / 2)
    elif gain == "agc":
        at = [crossover(axis)]
        models = stack([specific_model(each) for each in actuators])
        nominal_actuator = specific_model(nominal_parameters(axis))
        K_total *= (abs(nominal_actuator.response(at)) / abs(models.response(at)))[:, 0]
    return K_total


def nominal_response(axis: Axis, frequency: ArrayLike, antialiasing: bool = True) -> ComplexArray:
    """f_en/u [units/V] of the nominal plant of Table 5.2 at `frequency` [Hz] (F,): (F,)."""
    actuator = specific_model(nominal_parameters(axis)).response(frequency)
    return total_gain(axis) * actuator * _filter(frequency, antialiasing)


def controller(axis: Axis) -> TransferFunction:
    """The reference controller f_en [units] -> u [V]: mu-PID of eq. 6.12, and a radial variant.

    Equation 6.12 is used in zero-pole-gain form, with frequencies times 2 pi, because its printed
    time-constant form is unstable. The thesis gives no radial controller: the one here has the same
    form, with its own gain and integral zero.
    """
    import control

    zeros, poles, gain = _controller(axis)
    return control.zpk(zeros, poles, gain, inputs="f_en", outputs="u")


def loop_response(axis: Axis, frequency: ArrayLike) -> ComplexArray:
    """Loop transfer function of reference controller and nominal plant at `frequency` [Hz] (F,):
    (F,), in continuous time.
    """
    s = 2j * np.pi * checked_frequency(frequency)[:, None]
    zeros, poles, gain = _controller(axis)
    response: ComplexArray = (s - zeros).prod(axis=1) / (s - poles).prod(axis=1)
    return gain * response * nominal_response(axis, frequency)


@cache
def crossover(axis: Axis) -> float:
    """Frequency [Hz] at which the magnitude of the nominal loop passes 1."""
    check_axis(axis)

    def level(decades: float) -> float:
        return math.log(abs(loop_response(axis, [10**decades])[0]))

    return 10 ** float(brentq(level, 0.0, 5.0, xtol=1e-14))  # exactly once, as the tests show


def phase_margin(axis: Axis) -> float:
    """Phase margin [deg] of the nominal loop, without delay or sampling."""
    return 180.0 + float(np.angle(loop_response(axis, [crossover(axis)])[0], deg=True))


def _controller(axis: Axis) -> tuple[RealArray, RealArray, float]:
    """Zeros and poles [rad/s] and gain of the reference controller."""
    check_axis(axis)
    gain, integral_zero = (12.9e6, 31.0) if axis == "focus" else (4.0e6, 50.0)
    zeros = -2 * np.pi * np.array([integral_zero, 230.0])
    poles = -2 * np.pi * np.array([1.6e-4, 9820.0, 14130.0])
    return zeros, poles, gain


def _filter(frequency: ArrayLike, antialiasing: bool) -> ComplexArray:
    s = 2j * np.pi * checked_frequency(frequency)
    corner = ANTIALIASING if antialiasing else math.inf
    response: ComplexArray = np.reciprocal(1 + s / corner)
    return response
