"""A results folder appears whole or not at all, whenever its process is killed."""

import json
import os
import threading
import time

import pytest

from workbench.bench.store import CHECKSUMS, Store, damage, files, seal
from workbench.errors import ResultError


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "results")


def publish(store, text="one", problem="a/b", key="1234abcd", **how):
    with store.writing(problem, key) as writer:
        folder = writer.start()
        (folder / "figures").mkdir()
        (folder / "figures" / "f.svg").write_text(text)
        (folder / "run.json").write_text(text)
        return writer.publish(**how)


def partial(store):
    """What lies about below .partial, the locks apart."""
    return [file.name for file in (store.root / ".partial").iterdir() if file.suffix != ".lock"]


def test_a_published_folder_is_whole_and_in_its_place(store):
    path = publish(store)
    assert path == store.folder("a/b", "1234abcd") == store.root / "a" / "b" / "1234abcd"
    assert files(path) == ["figures/f.svg", "run.json"]
    assert damage(path) == []
    assert store.folders() == [path]
    assert partial(store) == []


def test_publishing_again_replaces_the_folder(store):
    publish(store, "one")
    path = publish(store, "two")
    assert (path / "run.json").read_text() == "two"
    assert store.folders() == [path]
    assert partial(store) == []


def test_a_failure_is_kept_beside_and_harms_no_earlier_result(store):
    good = publish(store, "good")
    bad = publish(store, "bad", failed=True)
    assert bad.name == "1234abcd.failed"
    assert [(p / "run.json").read_text() for p in (good, bad)] == ["good", "bad"]
    assert damage(good) == damage(bad) == []
    assert store.folders() == [good]


def test_a_success_clears_the_failure_before_it(store):
    bad = publish(store, "bad", failed=True)
    publish(store, "good")
    assert not bad.exists()


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_while_writing_leaves_the_earlier_result_and_nothing_else(store, error):
    path = publish(store, "one")
    with pytest.raises(error), store.writing("a/b", "1234abcd") as writer:
        (writer.start() / "run.json").write_text("two")
        raise error
    assert (path / "run.json").read_text() == "one"
    assert damage(path) == [] and partial(store) == []


def test_an_unwritable_root_is_a_clear_error(tmp_path):
    (tmp_path / "results").write_text("a file")
    with pytest.raises(ResultError, match="cannot write results below"):
        publish(Store(tmp_path / "results"))


def test_problems_inside_the_name_of_another_keep_apart(store):
    paths = [publish(store, problem=name) for name in ("a", "a/b", "a/b/c")]
    assert store.folders() == sorted(paths)


def test_references_are_not_listed_among_the_results(store):
    publish(store, problem="reference/a")
    path = publish(store, problem="a")
    assert store.folders() == [path]


def test_one_question_is_written_by_one_at_a_time(store):
    order = []

    def write(name):
        with store.writing("a", "1"):
            order.append(name)
            time.sleep(0.05)
            order.append(name)

    threads = [threading.Thread(target=write, args=(i,)) for i in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert order[::2] == order[1::2]


def test_listing_does_not_disturb_a_live_writer(store):
    with store.writing("a", "1") as writer:
        (writer.start() / "run.json").write_text("half")
        assert Store(store.root).folders() == []
        path = writer.publish()
    assert store.folders() == [path]


# --- killed -----------------------------------------------------------------------------------


@pytest.mark.parametrize("problem", ["a", "a/b", "d-k", "d+k/a", "a b/c", "a.b"])
@pytest.mark.parametrize("verb", ["list", "write"])
def test_a_swap_cut_short_is_mended_at_the_next_start(store, problem, verb):
    path = publish(store, "one", problem)
    with store.writing(problem, "1234abcd") as writer:
        space, new, old = writer.space, writer.new, writer.old
    new.mkdir(parents=True)  # as a process leaves it that was killed between the two renames
    path.rename(old)
    again = Store(store.root)
    if verb == "write":
        with again.writing(problem, "1234abcd"):
            pass
    else:
        assert again.folders() == [path]
    assert (path / "run.json").read_text() == "one"
    assert damage(path) == []
    assert not space.exists()


KILLED_AT_EVERY_STEP = """
import json, os, shutil, signal, sys
from pathlib import Path

import workbench as wb
from workbench.bench.store import Store, damage

root, steps = Path("results"), []
wb.run("toy/root", drawn=True)  # warms up, and must never be harmed
path = wb.run("toy/root").path
failed = path.with_name(path.name + ".failed")

def clear(folder):
    shutil.rmtree(folder, ignore_errors=True)

def broken():
    inside = {{p.parent for name in ("*.json", "SHA256SUMS") for p in root.rglob(name)}}
    return [f"{{p.name}}: {{damage(p)}}" for p in inside if ".partial" not in p.parts and damage(p)]

status = 1
while status:
    {before}
    pid = os.fork()
    if pid == 0:
        count = 0

        def hook(event, arguments):
            global count
            writes = event == "open" and arguments[2] & (os.O_WRONLY | os.O_RDWR)
            if event in ("os.mkdir", "os.rename", "os.remove", "os.rmdir") or writes:
                count += 1
                if count == len(steps) + 1:
                    os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(hook)
        {action}
        os._exit(0)
    status = os.waitpid(pid, 0)[1]
    at_once = broken()
    finished = len(Store(root).folders())
    left = [p.name for p in root.glob(".partial/*") if p.suffix != ".lock"]
    steps.append([status, at_once, broken(), finished, left])
print(json.dumps([steps, path.exists(), failed.exists(), wb.run("toy/root").reused]))
"""


@pytest.mark.cases(0)
@pytest.mark.skipif(os.name == "nt", reason="Windows cannot fork")
@pytest.mark.parametrize(
    ("before", "action", "finished"),
    [
        ("clear(path)", 'wb.run("toy/root")', {1, 2}),
        pytest.param(
            'wb.run("toy/root")', 'wb.run("toy/root", fresh=True)', {2}, marks=pytest.mark.slow
        ),
        pytest.param(
            'wb.run("toy/root", "lying")',
            'wb.run("toy/root", "lying")',
            {2},
            marks=pytest.mark.slow,
        ),
        pytest.param(
            'clear(failed); wb.run("toy/root").path.rename(failed)',
            'wb.run("toy/root")',
            {1, 2},
            marks=pytest.mark.slow,
        ),
    ],
    ids=["new", "replaced", "failed again", "failed before"],
)
def test_killed_at_any_step_every_folder_is_whole(project, before, action, finished):
    """One process is killed before it writes first, the next before it writes a second time ..."""
    code = KILLED_AT_EVERY_STEP.format(before=before, action=action)
    steps, good, failed, reused = json.loads(project.python(code))
    assert len(steps) > 10 and {status for status, *_ in steps[:-1]} == {9}
    for number, (_, at_once, mended, count, left) in enumerate(steps, start=1):
        assert not at_once, f"killed at step {number}"
        assert not mended, f"killed at step {number}, then mended"
        assert count in finished, f"killed at step {number}"
        assert not left, f"killed at step {number}"
    assert (good, failed, reused) == (True, False, True)


# --- checksums --------------------------------------------------------------------------------


@pytest.fixture
def folder(store):
    return publish(store)


def test_a_changed_file_is_named_with_both_checksums(folder):
    (folder / "run.json").write_text("two!")
    (found,) = damage(folder)
    assert found.startswith("run.json was changed: SHA-256 ")
    assert "(4 bytes now)" in found


@pytest.mark.parametrize(
    ("harm", "found"),
    [
        (lambda f: (f / "run.json").unlink(), ["run.json is missing"]),
        (lambda f: (f / "figures/f.svg").unlink(), ["figures/f.svg is missing"]),
        (lambda f: (f / "new.txt").touch(), [f"new.txt is not in {CHECKSUMS}"]),
        (
            lambda f: (f / "run.json").rename(f / "moved.json"),
            ["run.json is missing", f"moved.json is not in {CHECKSUMS}"],
        ),
        (
            lambda f: (f / CHECKSUMS).unlink(),
            [f"{CHECKSUMS} is missing: the folder is not a finished result"],
        ),
        (
            lambda f: (f / CHECKSUMS).write_text(""),
            [f"{name} is not in {CHECKSUMS}" for name in ("figures/f.svg", "run.json")],
        ),
    ],
    ids=["missing", "missing below", "extra", "renamed", "no checksums", "empty checksums"],
)
def test_damage_is_a_sentence_per_file(folder, harm, found):
    harm(folder)
    assert damage(folder) == found


@pytest.mark.parametrize(
    "content", [b"abc  run.json\n", b"no gap\n", b"\xff\xfe\n", b"0" * 64 + b"\n"], ids=repr
)
def test_unreadable_checksums_are_damage_not_an_exception(folder, content):
    (folder / CHECKSUMS).write_bytes(content)
    assert CHECKSUMS in damage(folder)[0]


def test_checksums_are_those_of_sha256sum(folder):
    if os.system("command -v sha256sum > /dev/null"):
        pytest.skip("no sha256sum here")
    assert os.system(f"cd '{folder}' && sha256sum --quiet --check {CHECKSUMS}") == 0


def test_sealing_again_gives_the_same_bytes(folder):
    before = (folder / CHECKSUMS).read_bytes()
    seal(folder)
    assert (folder / CHECKSUMS).read_bytes() == before
