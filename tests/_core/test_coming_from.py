"""Names of other tools are answered, and every line that shows their use here runs."""

import subprocess
import sys
from functools import cache, reduce

import matplotlib.pyplot as plt
import pytest
from tables import each

import workbench as wb
from workbench._core import coming_from
from workbench._core.coming_from import guidance, guides

ROWS = {
    f"{guide.page}-{number}-{(*row.names, row.call)[0]}": (guide, row)
    for guide in guides()
    for number, row in enumerate(guide.rows)
}
TYPED = """
    allmargin append armax arx balred bode c2d diskmargin disk_margins dksyn fitfrd fitmagfrd frd
    gapmetric h2syn hinfnorm hinfstruct hinfsyn loopsyn lqr makeweight margin mixsyn
    model_reduction mussv musyn n4sid ncfmargin ncfsyn norm nyquist reduce robgain robstab
    robuststab sample_system ssest stability_margins step system_norm systune tf tfest ucomplex
    ucover ultidyn ureal usample usubs wcgain wcsigmaplot
"""


def found(name):
    return reduce(getattr, name.split("."), wb)


@cache
def ground(guide):
    """What the statements of a guide define."""
    space = {}
    exec(guide.setup, space)
    return space


@pytest.mark.parametrize(("guide", "row"), ROWS.values(), ids=ROWS)
def test_a_row_names_what_exists_and_its_line_runs(guide, row, monkeypatch):
    monkeypatch.setattr(plt, "show", lambda: None)
    for name in row.here:
        assert found(name) is not None
    assert row.here or row.remark.startswith(("use ", "write ")), "what to use instead"
    value = eval(row.line, dict(ground(guide)))
    assert value is not None
    if isinstance(value, wb.Solution):
        assert value.certificate.valid
    plt.close("all")


@pytest.mark.parametrize("guide", guides(), ids=lambda guide: guide.page)
def test_a_name_has_one_row_of_a_guide(guide):
    names = [name for row in guide.rows for name in row.names]
    assert len(names) == len({*names})


@each("name", TYPED.split())
def test_what_users_type_is_answered_by_the_package_and_by_its_rooms(name):
    for room in (wb, wb.mu, wb.synthesis, wb.simulation, wb.structure):
        if not hasattr(room, name):
            with pytest.raises(AttributeError, match=f"'{name}'; .*'s {name} is .* guide: docs/"):
                getattr(room, name)


def test_the_answer_says_where_to_go():
    with pytest.raises(
        AttributeError,
        match=r"module 'workbench' has no attribute 'hinfsyn'; MATLAB's hinfsyn is "
        r"workbench\.synthesis\.hinf here, as in `.*`; guide: docs/coming-from/matlab-robust\.md",
    ):
        wb.hinfsyn  # noqa: B018
    assert guidance("lqr").endswith(
        "lqr is not here; use python-control's `control.lqr`; for example "
        "`control.lqr(G0.A, G0.B, np.eye(2), 1)`; guide: docs/coming-from/matlab-robust.md"
    )
    assert guidance("no_such_name") == ""


def test_an_import_of_a_name_of_another_tool_is_answered_too():
    with pytest.raises(ImportError, match=r"'musyn' from 'workbench\.mu'; MATLAB's musyn is"):
        from workbench.mu import musyn  # noqa: F401
    with pytest.raises(ImportError, match="cannot import name 'lqr' from 'workbench'; MATLAB's"):
        from workbench import lqr  # noqa: F401
    assert not hasattr(wb, "hinfsyn") and getattr(wb.mu, "lqr", None) is None


def test_a_module_whose_name_another_tool_has_is_imported(tmp_path, monkeypatch):
    (tmp_path / "cupboard").mkdir()
    (tmp_path / "cupboard" / "__init__.py").write_text(
        "from workbench._core.on_demand import no_more_names\n"
        "__getattr__ = no_more_names(__name__)\n"
    )
    (tmp_path / "cupboard" / "step.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    from cupboard import step

    assert step.__name__ == "cupboard.step"
    with pytest.raises(ImportError, match="MATLAB's bode is not here"):
        from cupboard import bode  # noqa: F401


def test_the_table_is_read_when_an_unknown_name_is_asked_for():
    """Those of Python's own protocols, and those that are there, never read it."""
    code = """
import sys, workbench as wb
for name in ("__wrapped__", "__path_hooks__", "_repr_html_", "_ipython_display_"):
    assert not hasattr(wb, name) and not hasattr(wb.structure, name)
wb.mu.robust_stability, dir(wb)
assert "workbench._core.coming_from" not in sys.modules
assert not hasattr(wb, "hinfsyn")
assert "workbench._core.coming_from" in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_table_is_beside_its_module():
    """So it is in a wheel."""
    assert {file.stem for file in coming_from.FOLDER.glob("*.toml")} == {
        guide.page for guide in guides()
    }
