"""The one printer of text tables: columns hold their cells, whatever these are."""

from hypothesis import given
from hypothesis import strategies as st

from lcp_lube.output.table import line, table

CELL = st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=12)


def test_columns_are_as_wide_as_their_longest_cell() -> None:
    assert table([["method", "s"], ["din", "12.5"], ["active-set", "1"]], align="<") == [
        "method         s",
        "din         12.5",
        "active-set     1",
    ]


def test_least_widths_gap_and_indent() -> None:
    assert table([("a", "first"), ("bc", "second")], align="<<", least=[4], gap=" ", indent="  ") == [
        "  a    first",
        "  bc   second",
    ]


def test_a_line_may_leave_its_last_columns_out() -> None:
    assert line(["a", "b"], [3, 3, 9], "<^") == "a     b"


@given(st.integers(1, 5).flatmap(lambda n: st.lists(st.lists(CELL, min_size=n, max_size=n), min_size=1, max_size=6)), st.data())
def test_every_cell_stands_in_its_column(rows: list[list[str]], data: st.DataObject) -> None:
    align = data.draw(st.text("<>^", max_size=len(rows[0])))
    lines = table(rows, align)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for cells, text in zip(rows, lines, strict=True):
        start = 0
        for cell, width in zip(cells, widths, strict=True):
            assert text[start : start + width].strip() == cell
            start += width + 2
        assert text == text.rstrip()
