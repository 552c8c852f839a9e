"""Plants of the process industry: a heater, two tanks, a boiler's level, a mixing tank, a pH."""

from __future__ import annotations

import numpy as np

from .stranger import Array, Channel, Demand, Parameters, Stranger, Test

KELVIN = 273.15
SMOOTH = 0.01
"""Head [cm] below which flow is proportional to the head instead of its square root."""


def root(head: Array) -> Array:
    """Square root of |head| [cm], with the sign of the head and a finite slope at zero."""
    rooted: Array = head / np.sqrt(np.abs(head) + SMOOTH)
    return rooted


# --- a heater: plate [degC] and thermometer [degC]; it loses heat by convection and by radiation --


def heater_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """Energy balance of the plate, and the lag of its thermometer; d is a lost power [W]."""
    plate, shown = x
    radiated = p.radiation * ((plate + KELVIN) ** 4 - (p.ambient + KELVIN) ** 4)
    heat = p.power * u[0] / 100.0 - p.convection * (plate - p.ambient) - radiated - d
    return np.array([heat / p.capacity, (plate - shown) / p.lag])


HEATER = Stranger(
    title="heater with ambient and delay",
    nominal={
        **{"power": 400.0, "convection": 2.2, "radiation": 3e-9, "ambient": 20.0},
        **{"capacity": 1500.0, "lag": 12.0, "delay": 15.0},
    },
    spread={
        **{"power": 0.08, "convection": 0.1, "ambient": 0.1, "capacity": 0.12},
        **{"lag": 0.15, "delay": 0.1},
    },
    slope=heater_slope,
    output=lambda x, p: x[1:],
    guess=(95.0, 95.0),
    rest_u=(50.0,),
    period=5.0,
    inputs=(Channel("power", "%", 0.0, 100.0),),
    outputs=(Channel("temperature", "degC", 0.0, 250.0, 0.03),),
    test=Test(800, (15.0,)),
    demand=Demand((4.0,), 0.15, 600.0, load=15.0),
    seed=6401,
    units=6,
)


# --- two coupled tanks: levels [cm], and the flow of the pump [cm^3/s] ---------------------------


def tanks_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """Torricelli's law between the tanks and at the outlet of the second; d is a flow into it
    [cm^3/s].
    """
    first, second, flow = x
    between, out = p.pipe * root(first - second), p.outlet * root(second)
    return np.array(
        [
            (flow - between) / p.area,
            (between - out + d) / p.area,
            (p.pump * u[0] - flow) / p.lag,
        ]
    )


TANKS = Stranger(
    title="two coupled tanks",
    nominal={"pump": 20.0, "pipe": 18.0, "outlet": 16.0, "area": 150.0, "lag": 3.0},
    spread={"pump": 0.08, "pipe": 0.12, "outlet": 0.1, "area": 0.02, "lag": 0.2},
    slope=tanks_slope,
    output=lambda x, p: x[1:2],
    guess=(45.0, 25.0, 80.0),
    rest_u=(4.0,),
    period=2.0,
    inputs=(Channel("pump", "V", 0.0, 10.0),),
    outputs=(Channel("level", "cm", 0.0, 60.0, 0.05),),
    test=Test(1200, (1.2,), delimiter=";"),
    demand=Demand((2.0,), 0.2, 400.0, load=6.0),
    seed=6402,
)


# --- the level of a boiler: water [mm], bubbles below it [mm], flow of feed water [mm/s] ----------


def boiler_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """Cold water first makes bubbles collapse, so the level falls before it rises; d is steam."""
    water, bubbles, feed = x
    leaked = p.leak * np.sqrt(np.maximum(water, 1.0))
    return np.array(
        [
            feed - p.steam - leaked - d,
            (-p.swell * feed - bubbles) / p.collapse,
            (p.valve * u[0] - feed) / p.lag,
        ]
    )


BOILER = Stranger(
    title="level of a boiler, with a zero right of the axis",
    nominal={
        **{"steam": 1.5, "leak": 0.025, "swell": 40.0, "collapse": 10.0},
        **{"valve": 0.04, "lag": 5.0},
    },
    spread={
        **{"steam": 0.01, "leak": 0.05, "swell": 0.1, "collapse": 0.15},
        **{"valve": 0.01, "lag": 0.2},
    },
    slope=boiler_slope,
    output=lambda x, p: x[0:1] + x[1:2] + 200.0,
    guess=(400.0, -80.0, 2.0),
    rest_u=(50.0,),
    period=4.0,
    inputs=(Channel("feed valve", "%", 0.0, 100.0),),
    outputs=(Channel("level", "mm", 0.0, 1500.0, 0.8),),
    test=Test(1500, (12.0,)),
    demand=Demand((20.0,), 0.25, 1200.0, load=0.1),
    seed=6403,
    units=4,
)


# --- a mixing tank of two outputs: level [cm], temperature [degC], and two valves -----------------


def mixing_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """Balances of volume and heat. The valves are slow; d is a flow of cold water [cm^3/s]."""
    level, temperature, hot, cold = x
    volume = p.area * np.maximum(level, 1.0)
    heat = hot * (p.hot - temperature) + (cold + d) * (p.cold - temperature)
    return np.array(
        [
            (hot + cold + d - p.outlet * root(level)) / p.area,
            heat / volume,
            (p.hot_valve * u[0] - hot) / p.lag,
            (p.cold_valve * u[1] - cold) / p.lag,
        ]
    )


MIXING = Stranger(
    title="mixing tank, two inputs and two outputs",
    nominal={
        **{"area": 200.0, "outlet": 18.0, "hot": 65.0, "cold": 12.0, "lag": 4.0},
        **{"hot_valve": 1.0, "cold_valve": 1.0},
    },
    spread={
        **{"outlet": 0.1, "hot": 0.04, "cold": 0.1, "lag": 0.15},
        **{"hot_valve": 0.08, "cold_valve": 0.08},
    },
    slope=mixing_slope,
    output=lambda x, p: x[:2],
    guess=(30.0, 38.0, 50.0, 50.0),
    rest_u=(50.0, 50.0),
    period=2.0,
    inputs=(Channel("hot valve", "%", 0.0, 100.0), Channel("cold valve", "%", 0.0, 100.0)),
    outputs=(
        Channel("level", "cm", 0.0, 80.0, 0.05),
        Channel("temperature", "degC", 0.0, 100.0, 0.05),
    ),
    test=Test(1000, (10.0, 10.0), delimiter=";"),
    demand=Demand((2.0, 1.5), 0.25, 500.0, load=5.0),
    seed=6404,
)


# --- neutralisation of an acid: excess of base [mol/l], and the base pump [ml/s] ------------------

WATER = 1e-14
"""Ion product of water."""


def neutral_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """Balance of the excess of base over acid; d is a flow of acid [ml/s]."""
    excess, base = x
    gained = base * (p.base - excess) - (p.acid_flow + d) * (p.acid + excess)
    return np.array([gained / p.volume, (p.pump * u[0] - base) / p.lag])


def acidity(x: Array, p: Parameters) -> Array:
    """pH from the balance of charges, [H] + excess = K / [H], and the slope of the electrode."""
    hydrogen = 0.5 * (-x[:1] + np.sqrt(x[:1] ** 2 + 4 * WATER))
    hydrogen = np.where(
        x[:1] > 0, WATER / (0.5 * (x[:1] + np.sqrt(x[:1] ** 2 + 4 * WATER))), hydrogen
    )
    return 7.0 - p.electrode * (np.log10(hydrogen) + 7.0)


ACID = Stranger(
    title="pH of a neutralisation, too nonlinear",
    nominal={
        **{"acid": 1e-3, "base": 2e-3, "acid_flow": 20.0, "volume": 2000.0},
        **{"pump": 0.2, "lag": 5.0, "electrode": 1.0},
    },
    spread={"acid": 0.1, "base": 0.05, "volume": 0.05, "lag": 0.2, "electrode": 0.03},
    slope=neutral_slope,
    output=acidity,
    guess=(1e-7, 10.0),
    rest_y=(7.2,),
    period=2.0,
    inputs=(Channel("base pump", "%", 0.0, 100.0),),
    outputs=(Channel("pH", "1", 0.0, 14.0, 0.02),),
    test=Test(1000, (8.0,)),
    demand=Demand((0.5,), 0.3, 600.0, load=0.5),
    seed=6405,
    refusable=True,
)
