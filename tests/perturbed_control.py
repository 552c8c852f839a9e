"""A loop whose control is perturbed, for tests of mixed norms."""

from workbench.structure import Full
from workbench.uncertainty import generalised_plant


def perturbed(G):
    """A plant whose control is perturbed, under a disturbance and noise."""
    return generalised_plant(
        [(G, "v", "x")],
        {"v": "u + d + delta", "y": "x + n"},
        perturbation=[(Full(1, 1), "u", "delta")],
        exogenous=["d", "n"],
        performance=["x", "u"],
        control="u",
        measurement="y",
    )
