"""paper/paper.md as build/paper.pdf, by pandoc and typst, both of PyPI: `make paper`."""

from pathlib import Path

import pypandoc
import typst

ROOT = Path(__file__).parent.parent


def main() -> None:
    build, paper = ROOT / "build", ROOT / "paper"
    build.mkdir(exist_ok=True)
    options = ["--citeproc", f"--bibliography={paper / 'paper.bib'}", "--standalone"]
    pypandoc.convert_file(paper / "paper.md", "typst", outputfile=build / "paper.typ", extra_args=options)
    typst.compile(build / "paper.typ", output=build / "paper.pdf")


if __name__ == "__main__":
    main()
