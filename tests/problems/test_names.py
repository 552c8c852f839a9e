"""The name of a problem leads to its file."""

import pytest
from tables import each

from workbench.bench.project import registry

ENTRIES = registry().entries


@each("entry", ENTRIES.values(), ids=ENTRIES)
def test_the_last_part_of_a_name_is_the_name_of_its_file(entry):
    """Hyphens become underscores; a file called problem.py goes by the name of its folder."""
    file = entry.file
    called = file.parent.name if file.stem == "problem" else file.stem
    assert entry.name.rpartition("/")[2].replace("-", "_") == called, f"{file}:{entry.line}"


@pytest.mark.cases(0)
@each("entry", ENTRIES.values(), ids=ENTRIES)
def test_its_data_files_are_there(entry):
    problem = registry().find(entry.name)
    assert problem.data_hashes().keys() == set(problem.settings.data)
