"""How a reader gets the notebooks."""

import pytest
from click.testing import CliRunner

from workbench.cli import main
from workbench.course import copy_notebooks, notebook_files
from workbench.errors import InputError


def test_there_are_ten_in_order():
    names = [file.name for file in notebook_files()]
    assert [int(name[:2]) for name in names] == list(range(1, 11))


def test_they_are_copied_and_never_written_over(tmp_path):
    copies = copy_notebooks(tmp_path / "course")
    assert [copy.read_bytes() for copy in copies] == [f.read_bytes() for f in notebook_files()]
    copies[0].write_text("a reader's own work")
    with pytest.raises(InputError, match=copies[0].name):
        copy_notebooks(tmp_path / "course")
    assert copies[0].read_text() == "a reader's own work"


def test_the_command_says_where_they_are(tmp_path):
    told = CliRunner().invoke(main, ["notebooks", "--to", str(tmp_path / "course")])
    assert told.exit_code == 0
    assert told.output.splitlines()[:10] == [
        str(tmp_path / "course" / file.name) for file in notebook_files()
    ]
