"""The same as one script: from records to C code, with every choice of the designer."""

import control

import workbench as wb
from workbench.synthesis import Implementation, MuSynthesis
from workbench.uncertainty import Responses, StadiumCover, generalised_plant

names = {"input": "torque", "output": "speed", "time": "t"}
plants = Responses.from_files("records/drive*.csv", **names, hold=True).within(0.5, 198)  # Hz
cover = wb.solve(StadiumCover(plants, order=3, confidence=0.95))
W_e, W_u = control.tf([0.5, 55.0], [1, 0.55]), control.tf([4.5e-5, 0.025], [1.8e-5, 1])
parts = [(cover, "u", "y"), (W_e, "e", "z_e"), (W_u, "u", "z_u")]
loop = {"exogenous": "r", "control": "u", "measurement": "e", "performance": ["z_e", "z_u"]}
plant = generalised_plant(parts, {"e": "r - y"}, **loop)
design = wb.solve(MuSynthesis(plant, order=4, stable=True, integral=True), method="fixed")
board = wb.solve(Implementation(cover, design, dt=5e-4, delay_samples=1.0, precision="float"))
print(design, board, sep="\n")
board.answer.export("controller.h")
