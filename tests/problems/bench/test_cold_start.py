"""First answers: what is measured of a process, and what the problem makes of it."""

import pytest
from workbench.plants.bench import cold_start as module
from workbench.plants.bench.cold_start import CASES, ColdStart, _processor_time

import workbench as wb


@pytest.mark.cases(0)
def test_the_time_is_that_of_the_script(tmp_path):
    idle = _processor_time("import time; time.sleep(0.5)", tmp_path)
    busy = _processor_time("sum(i * i for i in range(10_000_000))", tmp_path)
    assert idle < 0.4 < busy + 0.3 and busy > idle


def test_a_script_that_fails_is_no_measurement(tmp_path):
    with pytest.raises(RuntimeError, match="no such plant"):
        _processor_time("raise ValueError('no such plant')", tmp_path)


def test_limits_are_those_of_cold_starts(monkeypatch):
    """Each case is cold once, then warm: here 30 s of processor time, then 1 s."""
    seen = set()

    def measured(script, folder):
        warm = (script, folder) in seen
        seen.add((script, folder))
        return 0.1 if "control" in script and "import workbench" not in script else 30.0 - 29 * warm

    monkeypatch.setattr(module, "_processor_time", measured)
    solution = wb.solve(ColdStart(2))
    cold = solution.answer["seconds"].sel(start="cold")
    assert (cold == 30.0).all() and (solution.answer["seconds"].sel(start="warm") == 1.0).all()
    checks = {check.name: check for check in solution.certificate.checks}
    for name, (_, wanted) in CASES.items():
        assert checks[name].holds is (wanted >= 30.0)
