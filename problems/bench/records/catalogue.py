"""Public records of inputs and outputs: contents, sources, and how to read their files.

The files are not in our repository, since most come without terms that allow it. Users bring their
own copies in one folder, under the published names.
"""

from __future__ import annotations

from dataclasses import dataclass

Columns = tuple[int | str, ...]

DAISY = (
    "De Moor B. (ed.), DaISy: Database for the Identification of Systems, Department of "
    "Electrical Engineering, ESAT/STADIUS, KU Leuven, Belgium"
)
DAISY_TERMS = "public, to be cited; no licence stated"


@dataclass(frozen=True)
class Section:
    """Columns of a file, counted from zero, or by name if the file names them."""

    file: str
    inputs: Columns
    outputs: Columns


@dataclass(frozen=True)
class PublicRecord:
    """A record with its source: ``sections`` are its two halves, or one section that is cut in
    half.

    ``sample_time`` [s] is None if it was not published. ``longest`` is the largest number of
    samples that are used of a record.
    """

    name: str
    about: str
    sample_time: float | None
    sections: tuple[Section, ...]
    citation: str
    source: str = "DaISy"
    terms: str = DAISY_TERMS
    longest: int | None = None


def _daisy(
    name: str,
    about: str,
    sample_time: float | None,
    inputs: range,
    outputs: range,
    citation: str,
) -> PublicRecord:
    section = Section(f"{name}.dat", tuple(inputs), tuple(outputs))
    return PublicRecord(name, about, sample_time, (section,), f"{citation}; {DAISY}")


RECORDS = (
    _daisy(
        "ballbeam", "angle of a beam to the position of a ball", 0.1, range(1), range(1, 2),
        "Van Overschee P., Subspace identification, PhD thesis, KU Leuven, 1995",
    ),
    _daisy(
        "CD_player_arm", "forces of two actuators to tracking", None, range(2), range(2, 4),
        "Van den Hof P., Schrama R., Automatica 29(6), 1993",
    ),
    _daisy(
        "cstr", "coolant flow of a stirred tank to concentration and temperature (simulated)",
        6.0, range(1, 2), range(2, 4), "Lightbody G., Irwin G., IEEE Trans. Neural Networks 8(3)",
    ),
    _daisy(
        "dryer", "voltage of a hair dryer to air temperature", 0.08, range(1), range(1, 2),
        "Ljung L., System Identification, 1987",
    ),
    _daisy(
        "dryer2", "industrial dryer: fuel, fan, raw material to two temperatures and moisture",
        10.0, range(1, 4), range(4, 7), "Chou C., Maciejowski J., IEEE Trans. Autom. Control 42(7)",
    ),
    _daisy(
        "evaporator", "four-stage evaporator: feed, vapour, cooling to dry matter, flow, heat",
        None, range(3), range(3, 6), "Zhu Y. et al., Proc. SYSID '94, Copenhagen",
    ),
    _daisy(
        "exchanger", "flow through a heat exchanger to outlet temperature", 1.0, range(1, 2),
        range(2, 3), "Bittanti S., Piroddi L., Journal of the Franklin Institute, 1996",
    ),
    _daisy(
        "flutter", "wing flutter", None, range(1), range(1, 2),
        "Feron E. et al., AIAA J. Guidance, Control & Dynamics 21(3), 1998",
    ),
    _daisy(
        "glassfurnace", "three heatings of a glass furnace to six temperatures", None,
        range(1, 4), range(4, 10), "Van Overschee P., De Moor B., Automatica 30(1), 1994",
    ),
    _daisy(
        "heating_system", "drive voltage of a halogen lamp to temperature", 2.0, range(1, 2),
        range(2, 3), "Dullerud G., Smith R., Int. J. Robust and Nonlinear Control, 1996",
    ),
    _daisy(
        "pHdata", "acid and base flows of a tank to pH (simulated)", 10.0, range(1, 3),
        range(3, 4), "McAvoy T., Hsu E., Lowenthal S., Ind. Eng. Chem. Process Des. Dev. 11, 1972",
    ),
    _daisy(
        "powerplant", "power plant of 120 MW: five flows to pressure and two temperatures",
        1228.8, range(5), range(5, 8), "Moonen M. et al., Int. J. Control 49, 1989",
    ),
    _daisy(
        "robot_arm", "reaction torque of a flexible arm to its acceleration", None, range(1),
        range(1, 2), "Van Brussel H., Swevers J., KU Leuven",
    ),
    _daisy(
        "steamgen", "steam generator: fuel, air, level, load to four outputs (simulated)", 3.0,
        range(1, 5), range(5, 9), "Pellegrinetti G., Bentsman J., IEEE Trans. CST 4(1), 1996",
    ),
    _daisy(
        "thermic_res_wall", "temperatures of both sides of a wall to its heat flow", None,
        range(2), range(2, 3), "Bloem J. (org.), System Identification Competition, JRC, 1994",
    ),
    _daisy(
        "winding", "winding process: speeds and currents to two web tensions", 0.1, range(5),
        range(5, 7), "Bastogne T. et al., Proc. 4th European Control Conference, 1997",
    ),
    PublicRecord(
        "gas_furnace", "gas rate of a furnace to CO2 in the outlet gas (series J)", 9.0,
        (Section("gas_furnace.csv", ("InputGasRate",), ("CO2",)),),
        "Box G., Jenkins G., Time Series Analysis, 1970", "Box and Jenkins", "printed in the book",
    ),
    PublicRecord(
        "cascaded_tanks", "pump of two cascaded tanks, with overflow, to the lower level", 4.0,
        (
            Section("dataBenchmark.csv", ("uEst",), ("yEst",)),
            Section("dataBenchmark.csv", ("uVal",), ("yVal",)),
        ),
        "Schoukens M. et al., Cascaded tanks benchmark, Workshop on Nonlinear System "
        "Identification Benchmarks, 2016", "nonlinearbenchmark.org", "CC BY-SA 4.0",
    ),
    PublicRecord(
        "buck", "duty cycle of a DC-DC buck converter to its voltage", 1e-5,
        (
            Section("buck_id.csv", ("input",), ("y",)),
            Section("buck_valid.csv", ("input",), ("y",)),
        ),
        "Aguirre L. et al., IEE Proc. Control Theory Appl. 147, 2000", "sysidentpy-data", "MIT",
    ),
    PublicRecord(
        "f16", "shaker of an F-16 on the ground, voltage and force, to acceleration", 0.0025,
        (Section("f-16.txt", (0, 1), (2,)),),
        "Noel J., Schoukens M., F-16 aircraft benchmark, Workshop on Nonlinear System "
        "Identification Benchmarks, 2017", "sysidentpy-data", "MIT (of the copy)", 8192,
    ),
    PublicRecord(
        "actuator", "valve of a hydraulic crane to oil pressure", None,
        (Section("actuator.mat", ("u",), ("p",)),),
        "Sjoberg J. et al., Automatica 31(12), 1995", "Linkoping University", "none stated",
    ),
    PublicRecord(
        "drive", "coupled electric drives: voltage to the speed of the pulley", 0.02,
        (Section("drive.mat", ("u1",), ("z1",)),),
        "Wigren T., Schoukens M., Coupled electric drives data set, Uppsala University, 2017",
        "nonlinearbenchmark.org", "CC BY-SA 4.0",
    ),
)  # fmt: skip
