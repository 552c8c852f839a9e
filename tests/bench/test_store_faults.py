"""What goes wrong about a results folder is an error of ours, and nothing is lost by it."""

import os
import signal
import subprocess
import sys

import pytest

import workbench as wb
from workbench.bench.store import Store
from workbench.errors import ResultError

posix = pytest.mark.skipif(os.name == "nt", reason="of POSIX")


def left(store):
    return sorted(file.name for file in (store.root / ".partial").iterdir())


def publish(store, text="1"):
    with store.writing("a/b", "1234abcd") as writer:
        (writer.start() / "run.json").write_text(text)
        return writer.publish()


@pytest.mark.parametrize(
    "place", ["results", "results/.partial", "results/toy", "results/toy/root"]
)
def test_a_file_where_a_folder_should_be(project, place):
    file = project.root / place
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("in the way")
    with pytest.raises(ResultError, match="cannot write results below"):
        wb.run("toy/root")
    assert file.read_text() == "in the way"


@pytest.mark.cases(0)
@posix
def test_a_full_disk_harms_no_earlier_result(project):
    """A limit on the size of a file stands for it; the signal that comes with it is ignored."""
    before = wb.run("toy/root")
    kept = {file.name: file.read_bytes() for file in before.path.iterdir()}
    code = (
        "import resource, signal, workbench as wb\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (200, 200))\n"
        "try:\n    wb.run('toy/root', fresh=True)\n"
        "except wb.errors.ResultError as error:\n    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "cannot write results below" in done.stdout and "too large" in done.stdout
    assert "Traceback" not in done.stderr
    assert {file.name: file.read_bytes() for file in before.path.iterdir()} == kept
    assert left(Store(project.results)) == []


@posix
@pytest.mark.skipif(hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_may_not_be_written(project):
    project.results.mkdir()
    project.results.chmod(0o500)
    with pytest.raises(ResultError, match="Permission denied"):
        wb.run("toy/root")


def test_locks_go_with_what_they_locked(tmp_path):
    store = Store(tmp_path)
    publish(store)
    assert left(store) == [] or os.name == "nt"


@posix
def test_a_lock_of_a_dead_process_is_removed_and_what_it_left_mended(tmp_path):
    store = Store(tmp_path)
    folder = publish(store)
    code = (
        "import os, signal, sys\nfrom workbench.bench.store import Store\n"
        "with Store(sys.argv[1]).writing('a/b', '1234abcd') as writer:\n"
        "    (writer.start() / 'run.json').write_text('2')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)])
    assert done.returncode == -signal.SIGKILL
    assert left(store) == ["a%2Fb-1234abcd", "a%2Fb-1234abcd.lock"]
    assert store.folders() == [folder]
    assert left(store) == []
    assert (folder / "run.json").read_text() == "1"


@posix
def test_who_waits_for_a_lock_that_is_removed_does_not_share_the_next_one(tmp_path):
    """Many processes count up under the lock; none may read what another is about to write."""
    code = (
        "import sys, pathlib, time\nfrom workbench.bench.store import Store\n"
        "count = pathlib.Path(sys.argv[1], 'count')\n"
        "for _ in range(20):\n"
        "    with Store(sys.argv[1]).writing('a/b', '1234abcd'):\n"
        "        n = int(count.read_text())\n        time.sleep(0.001)\n"
        "        count.write_text(str(n + 1))\n"
    )
    (tmp_path / "count").write_text("0")
    several = [subprocess.Popen([sys.executable, "-c", code, str(tmp_path)]) for _ in range(3)]
    assert [one.wait(timeout=120) for one in several] == [0, 0, 0]
    assert (tmp_path / "count").read_text() == "60"


def test_a_strangers_half_written_folder_leads_nowhere(tmp_path):
    root = tmp_path / "inner" / "results"
    old = root / ".partial" / "..%2F..%2Foutside-1234abcd" / "old"
    old.mkdir(parents=True)
    (old / "run.json").write_text("{}")
    assert Store(root).folders() == []
    assert not (tmp_path / "outside").exists() and old.exists()
