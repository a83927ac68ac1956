"""This package's docstrings for napoleon: 'name : what it is' has no type before the words, as napoleon would take it."""

import re
from typing import Any

HEADS = ("Parameters", "Attributes", "Returns", "Raises", "Yields")


def plain(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Sections as lists of definitions; indented blocks as they stand, sentences with no markup in them."""
    out: list[str] = []
    k, inside = 0, False
    while k < len(lines):
        line = lines[k]
        if line in HEADS and k + 1 < len(lines) and set(lines[k + 1]) == {"-"}:
            out += [f"**{line}**", ""]
            inside, k = True, k + 2
            continue
        entry = re.match(r"(\S[^:]*?) : (.*)", line) if inside else None
        if entry:
            words = [entry[2]]
            while k + 1 < len(lines) and (lines[k + 1].startswith("    ") or lines[k + 1] == ""):
                k += 1
                if lines[k] == "" and not (k + 1 < len(lines) and lines[k + 1].startswith("    ")):
                    break
                words.append(lines[k].strip())
            out += [f"* ``{entry[1]}``: {escaped(' '.join(words))}", ""]
        elif line.startswith("    ") and not inside:
            if not (out and (out[-1].startswith("    ") or out[-1] == "")):
                out.append("")
            if not any(earlier.startswith("    ") for earlier in out[-2:]):
                out += ["::", ""]
            out.append(line)
        else:
            if out and out[-1].startswith("    ") and line:
                out.append("")
            out.append(escaped(line))
        k += 1
    lines[:] = out


def escaped(text: str) -> str:
    """Words with none of them taken for markup; `name` is code."""
    parts = re.split(r"(``.*?``|`[^`]+`)", text)
    return "".join(
        f"``{part.strip('`')}``" if part.startswith("`") else re.sub(r"([*|\\])|_(?=\W|$)", lambda m: "\\" + m[0], part)
        for part in parts
    )


def setup(app: Any) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", plain, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
