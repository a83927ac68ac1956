"""Machine code that is kept between runs."""

import importlib
import sys

import pytest

from lcp_lube.base import compiled

pytest.importorskip("numba")


def test_code_is_made_anew_where_a_piece_or_a_number_of_another_file_has_changed(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    head = "from lcp_lube.base.compiled import kernel, piece\n"
    (tmp_path / "changed_loop.py").write_text(f"{head}from changed_piece import BY, f\n@kernel\ndef g(x): return f(x) + BY\n")

    def found(by: int, plus: int) -> tuple[float, int]:
        (tmp_path / "changed_piece.py").write_text(f"{head}BY = {plus}\n@piece\ndef f(x): return {by} * x\n")
        for name in ("changed_loop", "changed_piece"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        compiled._text.cache_clear()
        loop = importlib.import_module("changed_loop").g
        return loop(3.0), sum(loop.stats.cache_hits.values())

    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    assert [found(2, 1), found(2, 1), found(4, 1), found(4, 5)] == [(7.0, 0), (7.0, 1), (13.0, 0), (17.0, 0)]
