"""Nonlinear multigrid (full approximation scheme)."""
