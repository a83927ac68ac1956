"""SuperLU_DIST with one OpenMP thread only: 8.1.2 gives wrong factors with more (benchmarks/README.md)."""

import ctypes

from petsc4py import PETSc


def one_thread_for_superlu_dist() -> bool:
    """Set OpenMP to one thread if an option asks for superlu_dist; true if there were more.

    OMP_NUM_THREADS, read when PETSc is loaded, may be unset or too large in a program that started PETSc itself. OpenMP is
    reached through the libraries that petsc4py depends on; without one there are no threads.
    """
    if "superlu_dist" not in PETSc.Options().getAll().values():
        return False
    library = ctypes.CDLL(PETSc.__file__)
    try:
        threads, limit = library.omp_get_max_threads(), library.omp_set_num_threads
    except AttributeError:
        return False
    limit(1)
    return bool(threads > 1)
