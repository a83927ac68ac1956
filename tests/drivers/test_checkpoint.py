"""Checkpoints: killed, interrupted and resumed runs end as the undisturbed one; what is no checkpoint of theirs is refused."""

import json
import os
import random
import resource
import shutil
import signal
import subprocess
import time

import numpy as np
import pytest
from conftest import ENVIRONMENT, Run, job

from lcp_lube import load_scene, solve
from lcp_lube.drivers import checkpoint
from lcp_lube.errors import InputError

NESTED = [
    "solve",
    "problem4",
    "--nx",
    "190",
    "--ny",
    "170",
    "--eps1",
    "1e-10",
    "--method",
    "active-set",
]  # four grids, multigrid inside


def start(words, folder, ranks=1, **more):
    """A run whose stderr can be watched."""
    pipe = subprocess.PIPE
    command = job(["-m", "lcp_lube", *map(str, words)], ranks)
    return subprocess.Popen(command, cwd=folder, env=ENVIRONMENT, stdout=pipe, stderr=pipe, text=True, **more)


def finish(words, folder, ranks=1, **more):
    job = start(words, folder, ranks, **more)
    out, err = job.communicate(timeout=120)
    return Run(job.returncode, out, err)


def stop(words, folder, after, number, delay=0.0, ranks=1):
    """Send a signal once the monitor has told of so many steps, and a while later; how the run ended and what else it said."""
    job = start([*words, "--monitor"], folder, ranks)
    for seen, _ in enumerate(job.stderr, start=1):
        if seen == after:
            time.sleep(delay)
            job.send_signal(number)
            break
    out, err = job.communicate(timeout=120)
    return Run(job.returncode, out, err)


def steps(run):
    """Monitor lines of a run."""
    return [line for line in run.err.splitlines() if "||F||" in line]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The undisturbed run: its JSON, the number of its steps, its fields."""
    folder = tmp_path_factory.mktemp("whole")
    run = finish([*NESTED, "--json", "--monitor", "--output", "x.npz"], folder)
    assert run.status == 0, run.err
    with np.load(folder / "x.npz") as fields:
        return run.json, len(steps(run)), {name: fields[name] for name in "pr"}


def check_same(run, folder, whole, rel):
    """The resumed run came to the same answer."""
    data, _, fields = whole
    assert run.status == 0, run.err
    assert run.json["outcome"] == "converged"
    for key in ("p_max", "load", "friction"):
        assert run.json[key] == pytest.approx(data[key], rel=rel)
    with np.load(folder / "x.npz") as again:
        for name, values in fields.items():
            np.testing.assert_allclose(again[name], values, rtol=0, atol=rel * np.abs(values).max())


RESUME = [*NESTED, "--resume", "c", "--json", "--monitor", "--output", "x.npz"]
MOMENTS = random.Random(1)


@pytest.mark.parametrize(
    "every, after, delay", [(every, MOMENTS.randint(every + 1, 7), MOMENTS.uniform(0, 0.1)) for every in (1, 1, 2, 3)]
)
def test_killed_and_resumed(tmp_path, whole, every, after, delay):
    """kill -9 at random moments: the same answer to 1e-12, and at most `every` steps made twice."""
    killed = stop([*NESTED, "--checkpoint", "c", "--every", every], tmp_path, after, signal.SIGKILL, delay)
    run = finish(RESUME, tmp_path)
    check_same(run, tmp_path, whole, 1e-12)
    data, total, _ = whole
    made = after + len(steps(killed))  # those seen before the signal and those read after it
    assert len(steps(run)) <= total - made + every
    assert run.json["iterations"] == data["iterations"]
    assert [level["iterations"] for level in run.json["levels"]] == [level["iterations"] for level in data["levels"]]


def test_other_ranks_go_on(tmp_path, whole):
    """Two ranks are stopped, three and then one go on; rounding and the inner solver's tolerance are all that differs."""
    killed = stop([*NESTED, "--checkpoint", "c"], tmp_path, 2, signal.SIGTERM, ranks=2)
    assert killed.status != 0
    kept = (tmp_path / "c").read_bytes()
    for ranks in (3, 1):
        (tmp_path / "c").write_bytes(kept)
        check_same(finish(RESUME, tmp_path, ranks), tmp_path, whole, 1e-8)


@pytest.mark.parametrize("number, status", [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_leaves_a_checkpoint(tmp_path, whole, number, status):
    """Saved at the end of the step that it met, whatever --every says. It comes where the third step is told."""
    (tmp_path / "signalled.py").write_text(f"""
import os, sys
from lcp_lube.__main__ import main
write, told = sys.stderr.write, []
def watched(text):
    told.extend(["||F||"] * text.count("||F||"))
    if len(told) == 3 and "||F||" in text:
        os.kill(os.getpid(), {int(number)})
    return write(text)
sys.stderr.write = watched
sys.exit(main())
""")
    words = [*NESTED, "--checkpoint", "c", "--every", "1000", "--monitor"]
    command = job([str(tmp_path / "signalled.py"), *words], 1)
    end = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=120)
    stopped = Run(end.returncode, end.stdout, end.stderr)
    assert stopped.status == status and "Traceback" not in stopped.err and len(steps(stopped)) == 3
    if number == signal.SIGINT:
        assert stopped.lines[-1] == "lcp-lube: interrupted; --resume c goes on"
    check_same(finish(RESUME, tmp_path), tmp_path, whole, 1e-12)


# --- every method, in this process


class Stopped(Exception):
    pass


def stopping_at(step):
    def monitor(k, _):
        if k == step:
            raise Stopped

    return monitor


PRESSED = "problem4", {"n": 24, "p_a": 1e6, "p_b": 1e6, "p_side": 1e6}  # six steps of the active set
CASES = {
    "din": ("problem1", {"n": 60}, {"method": "din"}),
    "din nested": ("problem2", {"n": 130}, {"method": "din", "nested": True}),
    "din-pc": ("problem4", {"n": 20}, {"method": "din-pc"}),
    "fbn-a": ("problem1", {"n": 60}, {"method": "fbn-a", "options": {"p0": 2.0}}),
    "active-set": (*PRESSED, {}),
    "iterative": ("problem1", {"n": 40}, {"method": "din", "system": "full", "recipe": "gmres_ilu"}),
    "fas": ("problem4", {"n": 40}, {"method": "fas", "stopping": {"eps1": 1e-10}}),
    "fas, obstacle": ("obstacle_bratu", {"n": 31}, {"method": "fas"}),
    "active-set, obstacle": ("obstacle_bratu", {"n": 15}, {"method": "active-set"}),
    "interior": ("obstacle_bratu", {"n": 15}, {"method": "interior"}),
    "semismooth": ("obstacle_bratu", {"n": 15}, {"method": "semismooth"}),
    "newton": ("bratu", {"n": 15}, {}),
    "took over": (*PRESSED, {"stopping": {"max_it": 3}}),
}


@pytest.mark.parametrize("case", CASES)
def test_every_method_takes_the_same_steps(tmp_path, case):
    """Stopped before step 3 of any grid and resumed: the record and the fields of the whole run, bit for bit."""
    name, changes, how = CASES[case]
    scene, file = load_scene(name, changes), tmp_path / "c"
    expected = solve(scene, **how, reduction=False)
    if case == "took over":
        assert expected.settings["took_over"]
    with pytest.raises(Stopped):
        solve(scene, **how, checkpoint=file, monitor=stopping_at(3))
    again = solve(scene, resume=file, stopping=how.get("stopping"))
    assert again.steps == expected.steps and again.outcome == expected.outcome and len(again.steps) >= 3
    for field, values in expected.fields.items():
        np.testing.assert_array_equal(again.fields[field], values)
    assert again.settings["method"] == expected.settings["method"]
    expected.destroy()
    again.destroy()


@pytest.mark.parametrize("stopped_at, failed", [(4, 1), (6, 2)])
def test_the_last_step_of_a_fallback(tmp_path, stopped_at, failed):
    """Stopped before the last step of the first or the second method that took over: that one goes on."""
    scene, how = load_scene(*PRESSED), {"stopping": {"max_it": 2}}
    expected, seen = solve(scene, **how, reduction=False), []

    def monitor(k, _):
        seen.append(k)
        if len(seen) == stopped_at:
            raise Stopped

    with pytest.raises(Stopped):
        solve(scene, **how, checkpoint=tmp_path / "c", monitor=monitor)
    record = checkpoint.load(tmp_path / "c", checkpoint.scene_record(scene)).record
    assert [outcome for outcome, _, _ in record["failed"]] == ["max_iterations"] * failed and len(record["steps"]) == 1
    made = []
    again = solve(scene, **how, resume=tmp_path / "c", monitor=lambda k, step: made.append(k))
    assert made == [2, *[1, 2] * 3][: len(expected.steps) - stopped_at + 1]
    assert again.steps == expected.steps and again.message == expected.message
    np.testing.assert_array_equal(again.fields["p"], expected.fields["p"])


# --- what is refused


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A checkpoint of problem 1 with 40 points."""
    path = tmp_path_factory.mktemp("saved") / "c"
    solve(load_scene("problem1", {"n": 40}), method="din", checkpoint=path, every=5).destroy()
    return path


def edited(saved, path, **changes):
    """A copy with another header, its checksum right."""
    import zlib

    data = saved.read_bytes()
    line, rest = data[:64], data[64:]
    length = int(line.split()[3])
    header = {**json.loads(rest[:length]), **changes}
    text = json.dumps(header).encode()
    path.write_bytes(
        f"lcp_lube checkpoint 1 {len(text)} {zlib.crc32(text):08x}".encode().ljust(63) + b"\n" + text + rest[length:]
    )


def cut(length):
    return lambda saved, path: path.write_bytes(saved.read_bytes()[:length])


def flip(place):
    def damage(saved, path):
        data = bytearray(saved.read_bytes())
        data[place] ^= 4
        path.write_bytes(data)

    return damage


@pytest.mark.parametrize(
    "damage, message",
    [
        (lambda saved, path: path.mkdir(), "Is a directory"),
        (lambda saved, path: None, "No such file or directory"),
        (lambda saved, path: path.write_bytes(b""), "no checkpoint of lcp_lube"),
        (lambda saved, path: path.write_text("h_min = 1e-5\n"), "no checkpoint of lcp_lube"),
        (lambda saved, path: path.write_bytes(saved.read_bytes().replace(b"checkpoint 1", b"checkpoint 7", 1)), "of format 7"),
        (lambda saved, path: edited(saved, path, version="0.0.1"), "written by lcp_lube 0.0.1, this is "),
        (cut(30), "damaged: its first line cannot be read"),
        (cut(500), "cut short: 500 bytes"),
        (cut(-8), "cut short: "),
        (lambda saved, path: path.write_bytes(saved.read_bytes() + b"more"), "damaged: "),
        (flip(100), "damaged: its header"),
        (flip(-7), "damaged: F1 is not what was written"),
    ],
)
def test_no_checkpoint(tmp_path, saved, damage, message):
    path = tmp_path / "c"
    damage(saved, path)
    with pytest.raises(InputError) as refused:
        solve(load_scene("problem1", {"n": 40}), resume=path)
    assert str(refused.value).startswith(f"--resume {path}: ") and message in str(refused.value)


@pytest.mark.parametrize("place", random.Random(2).sample(range(64, 1200), 8))
def test_no_single_byte_can_change(tmp_path, saved, place):
    path = tmp_path / "c"
    flip(place)(saved, path)
    with pytest.raises(InputError, match="damaged"):
        solve(load_scene("problem1", {"n": 40}), resume=path)


@pytest.mark.parametrize(
    "scene, changes, how, message",
    [
        ("problem2", {"n": 40}, {}, "a checkpoint of another scene: its p_a is 0.0, here it is 1000000.0"),
        ("problem1", {"n": 41}, {}, "a checkpoint of another scene: its n is 40, here it is 41"),
        ("problem1", {"n": 40, "h_min": 1e-5}, {}, "its h_min is 1.5e-05, here it is 1e-05"),
        ("problem1", {"n": 40}, {"method": "din-pc"}, "the run was begun with method din, not din-pc"),
        ("problem1", {"n": 40}, {"options": {"p0": 3.0}}, "the run was begun with options {}, not {'p0': 3.0}"),
    ],
)
def test_another_run(saved, scene, changes, how, message):
    with pytest.raises(InputError) as refused:
        solve(load_scene(scene, changes), resume=saved, **how)
    assert message in str(refused.value)


def test_other_tolerances_go_on(saved):
    """What ends a run may change: a run that was cut off at its limit goes on."""
    scene = load_scene("problem1", {"n": 40})
    short = solve(scene, resume=saved, stopping={"max_it": 31})
    longer = solve(scene, resume=saved, stopping={"max_it": 500})
    assert longer.converged and longer.iterations >= short.iterations


def test_methods_that_cannot_be_resumed(tmp_path):
    with pytest.raises(InputError, match="--checkpoint: a run of MixedInterior cannot be taken up again"):
        solve(load_scene("ehl_line", {"n": 20}), method="interior", checkpoint=tmp_path / "c")


@pytest.mark.parametrize(
    "words, message",
    [
        ("--every 3", "--every 3: at least 1, and --checkpoint FILE, are needed"),
        ("--checkpoint c --every 0", "--every 0: at least 1"),
        ("--checkpoint /no/such/folder/c", "--checkpoint /no/such/folder/c: folder /no/such/folder does not exist"),
        ("--checkpoint .", "--checkpoint .: is a folder"),
        ("--resume nowhere", "--resume nowhere: No such file or directory"),
    ],
)
def test_bad_options(capsys, tmp_path, monkeypatch, words, message):
    from lcp_lube.__main__ import main

    monkeypatch.chdir(tmp_path)
    assert main(["solve", "problem1", "--n", "20", *words.split()]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith(f"lcp-lube: {message}")


# --- a full disk


def check_full(run, file):
    assert run.status == 2 and "Traceback" not in run.err
    assert len(run.lines) == 1 and run.lines[0].startswith(f"lcp-lube: --checkpoint {file}: could not be written: "), run.err
    assert not [name for name in os.listdir(os.path.dirname(file)) if name.endswith(".new")]


def test_a_file_limit(tmp_path):
    """The first grids' checkpoints fit, a later one does not: the last one that did is left, and good."""
    scene, limit, before = load_scene("problem4", {"nx": 190, "ny": 170}), 300_000, resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))  # here, as MPI's own files at its start are larger
    try:
        with pytest.raises(InputError) as refused:
            solve(scene, method="active-set", checkpoint=tmp_path / "c")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert str(refused.value).endswith("could not be written: File too large; the last one is still there")
    assert os.listdir(tmp_path) == ["c"]
    assert len(checkpoint.load(tmp_path / "c", checkpoint.scene_record(scene)).shapes) == 2


def test_a_full_disk(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = shutil.which("mount")
    if (
        mount is None
        or subprocess.run([mount, "-t", "tmpfs", "-o", "size=300k", "tmpfs", disk], capture_output=True).returncode
    ):
        pytest.skip("cannot mount a small disk here")
    try:
        run = finish([*NESTED, "--checkpoint", disk / "c"], tmp_path)
        check_full(run, str(disk / "c"))
        assert "No space left on device" in run.err
    finally:
        subprocess.run(["umount", disk], check=True)
