"""Heaters that stand for a plant: nonlinear, late, each with an ambient of its own."""

from __future__ import annotations

from scipy.optimize import brentq

STEFAN_BOLTZMANN = 5.67e-8
REST = 50.0
"""Power [%] at the working point."""


class Heater:
    """Power [%] to temperature [deg C]: convection and radiation, a dead time, a slow sensor."""

    def __init__(self, rng, period, ambient=None):
        def about(value, share):
            return value * (1 + share * rng.uniform(-1, 1))

        self.period, self.capacity = period, about(20.0, 0.08)
        self.convection, self.radiation = about(0.18, 0.08), about(1e-3, 0.1)
        self.watts, self.sensor_time = about(0.12, 0.05), about(4.0, 0.15)
        self.dead = round(about(3.0, 0.1) / period)
        self.ambient = rng.uniform(18, 22) if ambient is None else ambient
        self.rest(REST)

    def rest(self, power):
        """Bring it to rest at a power."""
        self.place = self.sensor = brentq(lambda place: self.flow(place, power), -50, 500)
        self.queue = [power] * self.dead

    def flow(self, place, power):
        lost = self.convection * (place - self.ambient)
        lost += (
            self.radiation
            * STEFAN_BOLTZMANN
            * ((place + 273.15) ** 4 - (self.ambient + 273.15) ** 4)
        )
        return self.watts * power - lost

    def step(self, power):
        """One period at this power; a power beyond 0 to 100 % does not exist."""
        assert 0.0 <= power <= 100.0
        self.queue.append(power)
        late, parts = self.queue.pop(0), 4
        for _ in range(parts):
            self.place += self.period / parts * self.flow(self.place, late) / self.capacity
            away = self.place - self.sensor
            self.sensor += self.period / parts * away / self.sensor_time
