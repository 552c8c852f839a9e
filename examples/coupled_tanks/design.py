"""Two coupled tanks: a cover for each path, one robust controller of two inputs, C code."""

import control

import workbench as wb
from workbench.synthesis import Implementation, MuSynthesis
from workbench.uncertainty import CircleCover, Responses, generalised_plant

BANDWIDTH = 0.02  # rad/s: the levels follow in a few minutes
EFFORT = 0.002  # m per l/min: weight of the pumps; |K S| may be at most 1 / EFFORT
PERIOD, DELAY = 1.0, 0.5  # s, samples


def covered(level: int, pump: int) -> wb.Solution:
    """Nominal and weight of the path from a pump to a level, from the records of all plants."""
    responses = Responses.from_files(
        f"records/plant*_pump{pump}.csv", input="flow", output=f"level{level}", time="time"
    ).within(0.0005, 0.02)
    return wb.solve(CircleCover(responses, order=3, zeros=1, complex_order=2, confidence=0.95))


def main() -> wb.Solution:
    paths = {(level, pump): covered(level, pump) for level in (1, 2) for pump in (1, 2)}
    W_e = control.tf([0.5, BANDWIDTH], [1, BANDWIDTH / 100])
    plant = generalised_plant(
        [
            *((path, f"u{pump}", f"y{level}{pump}") for (level, pump), path in paths.items()),
            *((W_e, f"e{n}", f"z{n}") for n in (1, 2)),
            *((EFFORT, f"u{n}", f"v{n}") for n in (1, 2)),
        ],
        {"e1": "r1 - y11 - y12", "e2": "r2 - y21 - y22"},
        exogenous=("r1", "r2"),
        control=("u1", "u2"),
        performance=("z1", "z2", "v1", "v2"),
        measurement=("e1", "e2"),
    )
    design = wb.solve(MuSynthesis(plant), method="dk")
    print(f"mu of robust performance, proven: {design.answer.upper:.3f}")
    board = wb.solve(
        Implementation(plant, design, PERIOD, delay_samples=DELAY, precision="float", order=8)
    )
    for name, margins in zip(("pump 1", "pump 2"), board.answer.margins, strict=True):
        print(f"{name}: gain {margins.gain[1]:.1f}, phase {margins.phase_deg:.0f} degrees")
    board.answer.export("controller.h")
    return board


if __name__ == "__main__":
    main()
