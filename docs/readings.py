"""Run the ledger's problems under other readings of the thesis, and store what the ledger reads.

It takes an hour on two cores. What is stored in the project's results folder is not run again.
"""

from workbench.plants.cd_drive.claims import summaries

import workbench as wb

if __name__ == "__main__":
    summaries.write(summaries.made(lambda problem, parameters: wb.run(problem, **parameters)))
