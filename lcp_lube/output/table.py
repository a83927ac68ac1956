"""Text tables: the one printer of all columns that are read on a terminal."""

from collections.abc import Sequence

GAP = "  "


def line(cells: Sequence[str], widths: Sequence[int], align: str = "", gap: str = GAP) -> str:
    """One line of a table whose widths are known, for rows that are printed as they come.

    Parameters
    ----------
    cells : text of the columns; fewer than widths leave the last columns out.
    align : a character a column, '<', '>' or '^'; columns beyond it are right-aligned.
    """
    sides = align.ljust(len(cells), ">")
    return gap.join(f"{cell:{side}{width}}" for cell, width, side in zip(cells, widths, sides, strict=False)).rstrip()


def table(
    rows: Sequence[Sequence[str]], align: str = "", least: Sequence[int] = (), gap: str = GAP, indent: str = ""
) -> list[str]:
    """Rows as lines, every column as wide as its longest cell.

    Parameters
    ----------
    rows : the cells of each line, the head first; all of one length.
    align : as `line` takes it.
    least : least widths of the first columns, so that tables under one another have one look.
    indent : before every line.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    widths = [max(width, low) for width, low in zip(widths, [*least, *[0] * len(widths)], strict=False)]
    return [indent + line(row, widths, align, gap) for row in rows]
