#!/usr/bin/env bash
# PETSc and petsc4py of the newest release from PyPI, compiled into .venv-petsc-new with Debian's direct solvers, and this
# package with its tests. Debian 12's hypre is too old for it: this is also the build without hypre.
# Some ten minutes the first time; then only what has a newer release is built again.
set -euo pipefail
cd "$(dirname "$0")/.."

fail() { echo "petsc-new: $*" >&2; exit 1; }

packages=(
  build-essential gfortran patchelf python3-dev python3-venv
  libopenmpi-dev openmpi-bin
  libopenblas-serial-dev # BLAS and LAPACK, without threads
  libmumps-dev libscalapack-openmpi-dev libsuperlu-dev libsuperlu-dist-dev libsuitesparse-dev
)
missing=()
for package in "${packages[@]}"; do
  [[ $(dpkg -s "$package" 2> /dev/null) == *" ok installed"* ]] || missing+=("$package")
done
((${#missing[@]} == 0)) || fail "first, as root: apt-get install --no-install-recommends ${missing[*]}"

venv=.venv-petsc-new
[[ -x $venv/bin/pip ]] || /usr/bin/python3 -m venv "$venv" # of its own: nothing of the system's PETSc or NumPy
pip() { "$venv/bin/python" -m pip --quiet --disable-pip-version-check "$@"; }

export PETSC_CONFIGURE_OPTIONS="--with-debugging=0 --with-fortran-bindings=0 --with-x=0 --with-make-np=${JOBS:-2}
  COPTFLAGS=-O2 CXXOPTFLAGS=-O2 FOPTFLAGS=-O2
  --with-blaslapack-lib=-lopenblas
  --with-scalapack-lib=-lscalapack-openmpi
  --with-mumps-include=/usr/include --with-mumps-lib=[-ldmumps,-lsmumps,-lzmumps,-lcmumps,-lmumps_common,-lpord]
  --with-superlu-include=/usr/include/superlu --with-superlu-lib=-lsuperlu
  --with-superlu_dist-include=/usr/include/superlu-dist --with-superlu_dist-lib=-lsuperlu_dist
  --with-suitesparse-include=/usr/include/suitesparse
  --with-suitesparse-lib=[-lspqr,-lumfpack,-lklu,-lcholmod,-lbtf,-lccolamd,-lcolamd,-lcamd,-lamd,-lsuitesparseconfig]"

echo "petsc-new: compiling into $venv ..."
pip install --upgrade 'setuptools<81' wheel cython numpy
pip install --no-binary mpi4py mpi4py # for Debian's Open MPI, and there for petsc4py to find
pip install --upgrade --no-build-isolation petsc # first: petsc4py is compiled against it
pip install --upgrade --no-build-isolation petsc4py
pip install --editable '.[plot,test,fast]'
"$venv/bin/python" -c '
from petsc4py import PETSc
print("petsc-new: PETSc", ".".join(map(str, PETSc.Sys.getVersion())), "is ready")'
