"""The program starts itself again: for `--ranks N` as an MPI job on this machine, and as processes beside it."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping
from typing import Any

from ..errors import InputError
from ..registry import PACKAGE
from .petsc import launched

# Open MPI wants these said by root, as in a container; nothing is run but this program, with the rights that it has.
ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}

QUIET = {"OMPI_MCA_orte_execute_quiet": "1", "PRTE_MCA_prte_execute_quiet": "1"}  # our exit status is no fault to be explained


def cores() -> int:
    """Of this machine, those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def begin(command: list[str], environment: Mapping[str, str], **streams: Any) -> "subprocess.Popen[str]":
    """A process that imports this very package, wherever that lies; out of reach of the terminal's interrupts."""
    path = [str(PACKAGE.parent), environment.get("PYTHONPATH", "")]
    environment = {**environment, "PYTHONPATH": os.pathsep.join(filter(None, path))}
    return subprocess.Popen(command, env=environment, text=True, start_new_session=True, **streams)


def run_on(ranks: int, words: list[str]) -> int:
    """Run this command line, without --ranks, on so many ranks; returns its exit status.

    Raises
    ------
    InputError : fewer than 1; inside an MPI job already; no mpiexec; more ranks than this machine has cores.
    """
    if not 1 <= ranks <= cores():
        raise InputError(f"--ranks {ranks}: from 1 to {cores()}, the cores of this machine, are allowed")
    if launched():
        raise InputError("--ranks: this is an MPI job already; its ranks are mpiexec's to say")
    command = [sys.executable, "-m", "lcp_lube", *_without(words)]
    if ranks > 1:
        mpiexec = shutil.which("mpiexec")
        if mpiexec is None:
            raise InputError("--ranks: no mpiexec on PATH (openmpi-bin or mpich)")
        command = [mpiexec, "-n", str(ranks), *command]
    environment = {"OMP_NUM_THREADS": "1", **QUIET, **(ROOT if os.geteuid() == 0 else {}), **os.environ}
    job = subprocess.Popen(command, env=environment)
    # Ctrl-C reaches the job too, which says what is kept of the run: wait for that.
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        status = job.wait()
    finally:
        signal.signal(signal.SIGINT, before)
    return status if status >= 0 else 128 - status


def _without(words: list[str]) -> list[str]:
    """The command line but for --ranks N or --ranks=N."""
    kept = [word for word in words if not word.startswith("--ranks=")]
    if "--ranks" in kept:
        at = kept.index("--ranks")
        del kept[at : at + 2]
    return kept
