#!/usr/bin/env bash
# A wheel beside the petsc4py and mpi4py that are there, in an environment of its own, outside of the checkout: it solves, lists its
# recipes, prints a published table and reads its page. tools/try_wheel.sh WHEEL
set -euo pipefail
wheel=$(realpath "$1")
root=$(realpath "$(dirname "$0")/..")
python=$(realpath "$root/.venv/bin/python")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

"$python" -m venv --system-site-packages env
# What setup.sh told .venv: where Debian keeps petsc4py. conda-forge's and PyPI's are found without it.
site=$(env/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
cp "$root"/.venv/lib/python3*/site-packages/petsc4py.pth "$site" 2> /dev/null || true
numpy=$("$python" -I -c 'import numpy; print(int(numpy.__version__.split(".")[0]) + 1)')
env/bin/python -m pip install --quiet --disable-pip-version-check "numpy<$numpy" "$wheel"

export OMP_NUM_THREADS=1
env/bin/python - "$folder" << 'EOF'
import sys
import lcp_lube
assert lcp_lube.__file__.startswith(sys.argv[1]), lcp_lube.__file__
from importlib.resources import files
assert all((files("lcp_lube.cli.explore") / name).is_file() for name in ("page.html", "page.js", "page.css"))
EOF
env/bin/lcp-lube --version
env/bin/lcp-lube solve problem4 --n 20 --recipe mumps --method din
env/bin/lcp-lube list > list.txt && grep -q superlu list.txt
env/bin/lcp-lube table 2 --quick > table.txt && test -s table.txt
env/bin/lcp-lube verify --quick
echo "try_wheel: $(basename "$wheel") works"
