"""Whether every link and picture of a built site leads to a page, and to a place on it, that is there: `make docs`."""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag


class Page(HTMLParser):
    """Targets and names of one page."""

    def __init__(self, path: Path):
        super().__init__()
        self.targets: list[str] = []
        self.names: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        for name, value in attributes:
            if value and name in ("href", "src"):
                self.targets.append(value)
            elif value and (name == "id" or (tag, name) == ("a", "name")):
                self.names.add(value)


def broken(site: Path) -> list[str]:
    """Links that lead nowhere, 'page: target' each."""
    pages = {path.resolve(): Page(path) for path in site.rglob("*.html")}
    found = []
    for path, page in pages.items():
        for target in page.targets:
            if ":" in target.split("/")[0] or target.startswith("//"):
                continue  # another site's, mail, data
            name, place = urldefrag(target)
            file = (path.parent / unquote(name.partition("?")[0])).resolve() if name else path
            there = file.exists() and (not place or file not in pages or unquote(place) in pages[file].names)
            if not there:
                found.append(f"{path.relative_to(site.resolve())}: {target}")
    return sorted(set(found))


if __name__ == "__main__":
    wrong = broken(Path(sys.argv[1]))
    print(*wrong, sep="\n", file=sys.stderr)
    sys.exit(1 if wrong else 0)
