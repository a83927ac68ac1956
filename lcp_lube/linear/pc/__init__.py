"""Preconditioners of the papers, and PETSc's under other names."""
