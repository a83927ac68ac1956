"""CHARTS.md beside the pictures: of every chart its sentence, where and when its runs were made, and the commands."""

import os
import re
from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI

from ..base.files import write_text
from ..base.resumable import Row
from ..base.together import on_all_ranks
from ..errors import InputError

NAME = "CHARTS.md"
HEAD = "# Charts: what the last full runs say\n\nWritten by `lcp-lube chart`; every number comes from the csv beside it.\n"


def write_log(results: Path, name: str, rows: Sequence[Row], text: str, pictures: Sequence[Path]) -> None:
    """Put a chart's section in the place of its old one. Collective."""
    path = results / NAME
    with on_all_ranks(MPI.COMM_WORLD):
        written = HEAD + "".join(_sections(path, name, rows, text, pictures)) if MPI.COMM_WORLD.rank == 0 else ""
    write_text(path, written)


def _sections(path: Path, name: str, rows: Sequence[Row], text: str, pictures: Sequence[Path]) -> list[str]:
    try:
        old = path.read_text(encoding="utf-8") if path.exists() else ""
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    sections = {part.partition("\n")[0]: "\n## " + part.strip() + "\n" for part in re.split(r"^## ", old, flags=re.M)[1:]}
    dates = sorted({row["date"] for row in rows if row.get("date")})
    machines = "; ".join(sorted({row["machine"] for row in rows if row.get("machine")}))
    petsc = ", ".join(sorted({row["petsc"] for row in rows if row.get("petsc")}))
    span = dates[0] if len(dates) == 1 else f"{dates[0]} to {dates[-1]}" if dates else "never"
    links = ", ".join(os.path.relpath(picture, path.parent) for picture in pictures)
    sections[name] = f"\n## {name}\n\n{links}: {len(rows)} runs, {span}, {machines}, PETSc {petsc}; {load(rows)}.\n\n{text}\n"
    return [sections[key] for key in sorted(sections)]


def load(rows: Sequence[Row]) -> str:
    """The machine's load during the runs, which says how far their seconds can be trusted."""
    told = sorted(float(row["load_average"]) for row in rows if row.get("load_average"))
    untold = len(rows) - len(told)
    said = [f"load average {told[0]:g} to {told[-1]:g} in {len(told)} runs"] if told else []
    said += [f"not noted in {untold} stored ones" if told else "load average not noted"] if untold else []
    return ", ".join(said)
