#!/usr/bin/env bash
# The set-up behind `make`, for Debian and Ubuntu: PETSc and Open MPI by apt, all else by pip into .venv.
# Asks for root only when a package is missing; safe to run again.
set -euo pipefail
cd "$(dirname "$0")/.."

fail() { echo "setup: $*" >&2; exit 1; }

packages=(
  python3-petsc4py-real # PETSc for Python: real numbers, 32-bit indices
  python3-mpi4py        # built with the same MPI as that PETSc
  openmpi-bin           # mpiexec
  libopenblas0-serial   # with the reference BLAS MUMPS is about four times slower
  python3-venv
)
python=/usr/bin/python3 # not the first on PATH: only the system's own sees the system's packages

command -v apt-get > /dev/null || fail "needs Debian or Ubuntu; elsewhere see docs/install.md"

missing=()
for package in "${packages[@]}"; do
  [[ $(dpkg -s "$package" 2> /dev/null) == *" ok installed"* ]] || missing+=("$package")
done
if ((${#missing[@]})); then
  root=(env)
  if ((EUID != 0)); then
    command -v sudo > /dev/null || fail "needs root or sudo to install ${missing[*]}; else see docs/install.md"
    root=(sudo env)
  fi
  # A fresh Ubuntu updates itself after boot and holds apt's lock meanwhile: wait for it.
  apt=("${root[@]}" DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300)
  "${apt[@]}" update
  "${apt[@]}" install --yes --no-install-recommends "${missing[@]}"
fi

# pip comes last into a virtual environment: without it, the making of .venv was interrupted.
[[ -x .venv/bin/pip ]] || "$python" -m venv --system-site-packages .venv

# Debian keeps petsc4py in a folder of each PETSc version and build, off Python's path. [0-9]. leaves out the 64-bit builds.
petsc=$(printf '%s\n' /usr/lib/petscdir/petsc[0-9].*/*-real/lib/python3/dist-packages | sort -V | tail -n 1)
[[ -d $petsc/petsc4py ]] || fail "python3-petsc4py-real is installed, but there is no petsc4py in $petsc"
echo "$petsc" > "$(.venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/petsc4py.pth"

# That petsc4py is compiled for the system's NumPy and cannot be imported with the next major release.
numpy=$("$python" -I -c 'import numpy; print(int(numpy.__version__.split(".")[0]) + 1)')
echo "setup: installing Python packages into .venv ..."
.venv/bin/python -m pip install --quiet --disable-pip-version-check "numpy<$numpy" --editable '.[plot,test,fast]'

.venv/bin/python -m compileall -q lcp_lube # a start then takes a third less; pip does so for a wheel

echo "setup: compiling loops, once ..."
for method in fas active-set; do # their machine code is kept beside them: half a minute here, not in the first run
  OMP_NUM_THREADS=1 .venv/bin/lcp-lube solve problem4 --n 150 --method $method > /dev/null
done

.venv/bin/python -c '
from petsc4py import PETSc
assert PETSc.ScalarType().dtype == "float64" and PETSc.IntType().dtype == "int32", "not the real, 32-bit build of PETSc"
print("setup: ready, with PETSc", ".".join(map(str, PETSc.Sys.getVersion())))'
