"""The words of a command line, parted into ours and PETSc's."""

import re
from pathlib import Path

from ..errors import InputError
from ..registry import scene_names


def split(argv: list[str]) -> tuple[list[str], list[str]]:
    """Ours and PETSc's arguments. A PETSc option takes the next word as its value unless that begins with a dash.

    `--` options and their values, and words that no PETSc option takes, are ours; so is a scene's name.
    """
    own: list[str] = []
    petsc: list[str] = []
    words = list(argv)
    while words:
        word = words.pop(0)
        if not re.match(r"-[A-Za-z]", word) or word == "-h":
            own.append(word)
            continue
        petsc.append(word)
        if words and (not words[0].startswith("-") or re.match(r"-[\d.]", words[0])):
            petsc.append(words.pop(0))
        if word == "-options_file":
            if petsc[-1] == word:
                raise InputError("-options_file: a file name is needed")
            check_options_file(petsc[-1])
    _free_scene(own, petsc)
    return own, petsc


def check_options_file(name: str) -> None:
    """Raise InputError for a file that PETSc would abort on: unreadable, or a line that is no option."""
    try:
        if Path(name).exists() and not (Path(name).is_file() or Path(name).is_dir()):
            raise InputError(f"-options_file {name}: is no ordinary file")  # a pipe would be empty when PETSc reads it
        lines = Path(name).read_text(encoding="utf-8").splitlines()
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"-options_file {name}: {getattr(error, 'strerror', None) or 'not a text file'}") from None
    if Path(name).suffix in (".yml", ".yaml"):
        return
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].split()
        if words and words[0].lower() != "alias" and not re.match(r"--?[A-Za-z]", words[0]):
            raise InputError(f"-options_file {name}, line {number}: {words[0]}: an option that begins with a dash is needed")


def _free_scene(own: list[str], petsc: list[str]) -> None:
    """Give SCENE back where a PETSc option before it has taken it for its value: `solve -log_view problem1`.

    Changes both lists in place, if no word of ours and exactly one value of PETSc's is a scene.
    """

    def is_scene(word: str) -> bool:
        return word.endswith(".toml") or word in scene_names()

    if own[:1] not in (["solve"], ["compare"], ["sweep"], ["explore"]) or any(is_scene(word) for word in own):
        return
    taken = [k for k, word in enumerate(petsc) if is_scene(word) and petsc[k - 1] != "-options_file"]
    if len(taken) == 1:
        own.insert(1, petsc.pop(taken[0]))
