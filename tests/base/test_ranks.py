"""`--ranks N`: the program as an MPI job of its own, with the same answer, the same messages and the same exit status."""

import os

import pytest

from lcp_lube import InputError
from lcp_lube.base import ranks

CORES = len(os.sched_getaffinity(0))
several = pytest.mark.skipif(CORES < 2, reason="one core")


@several
def test_the_same_answer(cli):
    one, two = (cli("solve", "problem4", "--n", "33", "--ranks", str(n), "--json") for n in (1, 2))
    assert (one.status, two.status) == (0, 0) and (one.json["ranks"], two.json["ranks"]) == (1, 2)
    assert two.json["load"] == pytest.approx(one.json["load"], rel=1e-9)


@several
def test_faults_are_one_line_and_keep_their_status(cli):
    refused = cli("solve", "nonsense", "--ranks=2")
    assert refused.status == 2 and len(refused.err.splitlines()) == 1 and "nonsense" in refused.err
    assert cli("solve", "problem1", "--n", "33", "--method", "din", "--max-it", "2", "--ranks", "2").status == 1


@pytest.mark.parametrize("n", ["0", str(CORES + 1)])
def test_more_ranks_than_cores_or_none_are_refused(cli, n):
    done = cli("solve", "problem4", "--ranks", n)
    assert done.status == 2 and f"--ranks {n}" in done.err and str(CORES) in done.err


def test_what_is_no_job_of_its_own_is_refused(monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    with pytest.raises(InputError, match="MPI job already"):
        ranks.run_on(1, ["solve", "problem4", "--ranks", "1"])
    monkeypatch.delenv("OMPI_COMM_WORLD_SIZE")
    if CORES > 1:
        monkeypatch.setenv("PATH", "")
        with pytest.raises(InputError, match="no mpiexec"):
            ranks.run_on(2, ["solve", "problem4", "--ranks", "2"])
