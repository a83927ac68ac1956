"""Csv files that are filled row by row."""

import csv

import pytest
from mpi4py import MPI

from lcp_lube.base.resumable import ResumableCsv


@pytest.mark.parametrize("fault", [KeyboardInterrupt, OSError])
def test_nothing_half_written_is_left(tmp_path, monkeypatch, fault):
    """Ctrl-C, or a full disk, in the middle of writing: the file is as it was before, and alone in its folder."""
    store = ResumableCsv(tmp_path / "s.csv", ["x", "y"], ["x"], MPI.COMM_WORLD)
    store.add({"x": 1, "y": 2})
    before = store.path.read_text()
    with monkeypatch.context() as here:
        here.setattr(csv.DictWriter, "writerows", lambda *rows: (_ for _ in ()).throw(fault("on purpose")))
        with pytest.raises(BaseException, match="on purpose"):
            store.add({"x": 2, "y": 3})
    assert store.path.read_text() == before and [path.name for path in tmp_path.iterdir()] == ["s.csv"]
    store.add({"x": 3, "y": 4})
    assert len(store.path.read_text().splitlines()) == 4
