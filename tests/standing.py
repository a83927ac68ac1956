"""Commands by fork: a standing process that has imported the package, but not started MPI and PETSc, has a child for each.

    python standing.py --serve SOCKET                      the standing process; ends with its standard input
    python standing.py SOCKET -m lcp_lube solve problem1   as `python -m lcp_lube solve problem1`, without the imports' 0.35 s
    mpiexec -n 2 python standing.py SOCKET FILE WORDS      a rank is forked where it runs, and starts MPI by itself

The child has the command's words, folder, streams and the launcher's variables; it ends as a new process does, and the command
with its status or by its signal. Where any other variable of the environment differs from those of the standing process, which
has read them, a new process is started instead.
"""

import _signal
import _socket
import marshal
import os
import sys

# Of a launcher of MPI jobs, read when MPI starts; what is looked up when it is needed; what has no meaning for a command.
LAUNCHER = (
    "OMPI_",
    "PMIX_",
    "PMI_",
    "PRTE_",
    "ORTE_",
    "PRRTE_",
    "HFI_",
    "IPATH_",
    "PWD",
    "OLDPWD",
    "PYTEST_",
    "_",
    "SHLVL",
    "PATH",
)
STARTS = ("petsc4py.init(", "lcp_lube.__main__", "lcp_lube.base.petsc")  # in programs that start PETSc themselves
FORWARDED = (_signal.SIGINT, _signal.SIGTERM, _signal.SIGHUP, _signal.SIGQUIT, _signal.SIGUSR1, _signal.SIGUSR2)


def ask(path: str, words: list[str]) -> None:
    """The command's side: hand everything over, pass signals on, end as the child ends. Without `socket`, which takes 10 ms."""
    connection = _socket.socket(_socket.AF_UNIX, _socket.SOCK_SEQPACKET)
    connection.connect(path)
    passed = [(_socket.SOL_SOCKET, _socket.SCM_RIGHTS, b"".join(fd.to_bytes(4, sys.byteorder) for fd in (0, 1, 2)))]
    connection.sendmsg([marshal.dumps((words, os.getcwd(), dict(os.environ)))], passed)
    child = told(connection)
    if child == 0:
        os.execv(sys.executable, [sys.executable, *words])

    def forward(number: int, _: object) -> None:
        try:  # noqa: SIM105  contextlib takes time to import
            os.kill(child, number)
        except ProcessLookupError:  # it has ended, and its status is on the way
            pass

    for number in FORWARDED:
        _signal.signal(number, forward)
    status = told(connection)
    if status < 0:
        if -status in FORWARDED:
            _signal.signal(-status, _signal.SIG_DFL)
        os.kill(os.getpid(), -status)
    os._exit(status)


def told(connection: "_socket.socket") -> int:
    """A number from the standing process; its end is no status 0."""
    answer = connection.recv(4)
    if not answer:
        sys.exit("the standing process has ended")
    return int.from_bytes(answer, "big", signed=True)


def preload() -> None:
    """Import what a command may import, MPI and PETSc without starting them, and leave these two to be found when they are."""
    import contextlib
    import gc
    import importlib.abc
    import importlib.machinery
    import pkgutil

    import mpi4py

    mpi4py.rc(initialize=False, finalize=True, thread_level="funneled")
    import petsc4py.lib
    from mpi4py import MPI

    import lcp_lube

    PETSc = petsc4py.lib.ImportPETSc()
    for module in pkgutil.walk_packages(lcp_lube.__path__, "lcp_lube."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    load_loops()
    with contextlib.suppress(ImportError):
        import matplotlib.backends.backend_agg
        import matplotlib.figure  # noqa: F401
    if MPI.Is_initialized() or PETSc.Sys.isInitialized():
        raise RuntimeError("an import has started MPI or PETSc")

    class Start(importlib.abc.MetaPathFinder, importlib.abc.Loader):
        """Starts each of the two where a new process would: at its first import."""

        def find_spec(self, name, path, target=None):
            return importlib.machinery.ModuleSpec(name, self) if name in ("mpi4py.MPI", "petsc4py.PETSc") else None

        def exec_module(self, module) -> None:
            if module.__name__ == "mpi4py.MPI":
                sys.modules[module.__name__] = MPI
                if not MPI.Is_initialized():  # PETSc may have come first
                    MPI.Init_thread(MPI.THREAD_FUNNELED)
            else:
                petsc4py.lib.ImportPETSc()._initialize()

    def imported(arch: str | None = None) -> object:
        sys.modules["petsc4py.PETSc"] = petsc4py.PETSc = PETSc
        return PETSc

    petsc4py.lib.ImportPETSc = imported
    for package, name in ((mpi4py, "MPI"), (petsc4py, "PETSc")):
        del sys.modules[f"{package.__name__}.{name}"]
        delattr(package, name)
    sys.meta_path.insert(0, Start())
    gc.collect()
    gc.freeze()  # what is shared is not gone through


def load_loops() -> None:
    """Take the machine code of all loops that the cache has, which a command would do by itself: 0.4 s for multigrid's.

    LLVM would take all of it down again when a command ends, 0.3 s: what is left of C's streams is written, and that is all.
    """
    import ctypes
    from typing import Any

    try:
        from numba.core.dispatcher import Dispatcher
    except ImportError:
        return
    own = [vars(module) for name, module in sys.modules.items() if name.startswith("lcp_lube.")]
    loops: set[Any] = {value for names in own for value in names.values() if isinstance(value, Dispatcher)}
    for loop in loops:
        cache, codegen = loop._cache, loop.targetctx.codegen()
        for key in cache._cache_file._load_index() if hasattr(cache, "_cache_file") else ():
            if key == cache._index_key(key[0], codegen):  # made for this processor
                loop.compile(key[0])
    libc = ctypes.CDLL(None)
    libc.on_exit(libc._exit, None)
    libc.__cxa_atexit(libc.fflush, None, None)  # called before, as it is registered later


def serve(path: str) -> list[str]:
    """Fork until standard input ends, which ends this process; returns in each child, with the words of its command."""
    import contextlib
    import select
    import socket

    own = dict(os.environ)
    known = {name: value for name, value in own.items() if not name.startswith(LAUNCHER)}
    preload()
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.bind(path)
    listener.listen(64)
    children: dict[int, tuple[int, int, socket.socket]] = {}  # by the descriptor that tells of a child's end
    waiting = select.poll()
    for stream in (0, listener.fileno()):
        waiting.register(stream, select.POLLIN)
    print("ready", flush=True)
    while True:
        for found, _ in waiting.poll():
            if found == 0:
                for _, pid, _ in children.values():
                    os.kill(pid, _signal.SIGKILL)
                os.unlink(path)
                with contextlib.suppress(OSError):  # whoever asked may have gone without
                    os.rmdir(os.path.dirname(path))
                os._exit(0)
            if found != listener.fileno():
                end, pid, connection = children.pop(found)
                waiting.unregister(end)
                waiting.unregister(connection)
                if found != end:  # the command was killed, and can pass nothing on
                    os.kill(pid, _signal.SIGKILL)
                status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
                children.pop(connection.fileno() if found == end else end)
                if found == end:
                    with contextlib.suppress(OSError):  # the command was killed meanwhile
                        connection.send(status.to_bytes(4, "big", signed=True))
                os.close(end)
                connection.close()
                break  # the other of the two may be among those found
            connection, _ = listener.accept()
            data, streams, _, _ = socket.recv_fds(connection, 1 << 20, 3)
            if not data:  # the command was killed before it said anything
                connection.close()
                continue
            words, folder, environment = marshal.loads(data)
            plain = {name: value for name, value in environment.items() if not name.startswith(LAUNCHER)}
            pid = os.fork() if plain == known else 0
            if plain == known and pid == 0:
                listener.close()
                for _, _, other in children.values():
                    other.close()
                connection.close()
                for number, stream in enumerate(streams):
                    os.dup2(stream, number)
                os.chdir(folder)
                os.environ.clear()
                os.environ.update(environment)
                if "PYTEST_XDIST_WORKER" in environment and "OMPI_COMM_WORLD_SIZE" not in environment:
                    os.nice(19)  # as the tests: ranks come first (see conftest.py)
                return words
            for stream in streams:
                os.close(stream)
            with contextlib.suppress(OSError):
                connection.send(pid.to_bytes(4, "big", signed=True))
            if pid == 0:
                connection.close()
                continue
            end = os.pidfd_open(pid)
            for stream in (end, connection.fileno()):
                waiting.register(stream, select.POLLIN)
                children[stream] = end, pid, connection


def run(words: list[str]) -> None:
    """As `python WORDS`: `-m MODULE ...`, `-c PROGRAM ...` or `FILE ...`."""
    import runpy

    import numpy as np

    np.random.seed()  # noqa: NPY002  not the one that all children would share
    sys.stdout.reconfigure(line_buffering=os.isatty(1))  # type: ignore[union-attr]
    if words[0] == "-m":
        sys.argv, sys.path[0] = words[1:], os.getcwd()
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    elif words[0] == "-c":
        start_petsc(words[1])
        sys.argv, sys.path[0] = ["-c", *words[2:]], ""
        exec(words[1], {"__name__": "__main__"})
    else:
        with open(words[0]) as program:
            start_petsc(program.read())
        sys.argv, sys.path[0] = words, os.path.dirname(words[0])
        runpy.run_path(words[0], run_name="__main__")


def leave(status: int) -> None:
    """End as Python does, but for taking down all modules: that would copy the pages of all that is shared, 0.12 s of a
    small solve's 0.22 s. Returns where the streams cannot be written, which Python tells."""
    import atexit
    import ctypes
    import threading

    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except (OSError, ValueError):
        return
    if PETSc := sys.modules.get("petsc4py.PETSc"):
        PETSc._finalize()
    if (MPI := sys.modules.get("mpi4py.MPI")) and MPI.Is_initialized() and not MPI.Is_finalized():
        MPI.Finalize()
    ctypes.CDLL(None).fflush(None)  # C's streams
    os._exit(status & 0xFF)


def start_petsc(program: str) -> None:
    """For a program that imports modules of the package, which in a new process start PETSc; they have been imported here."""
    if "lcp_lube" in program and not any(own in program for own in STARTS):
        from petsc4py import PETSc  # noqa: F401


if __name__ == "__main__":
    if sys.argv[1] == "--serve":
        given, status = serve(sys.argv[2]), 0
        try:
            run(given)
        except SystemExit as end:
            if not isinstance(end.code, int | None):
                raise
            status = end.code or 0
        leave(status)
        sys.exit(status)
    else:
        ask(sys.argv[1], sys.argv[2:])
