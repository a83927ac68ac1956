"""No more physics than counts: effects that change the quantity asked for by less than a tenth of the tolerance are left out.

The film without effects is solved, on the scene's own grid or a coarser one, and what each effect changes is taken to first
order on its answer (`first_order`): one transposed solve for all of them. Those that change the quantity by less than a tenth
of the tolerance (`accuracy`, else 1 %), and could not by acting on the others, are left out; where that is not sure it is taken
again on the answer with those kept. On its own grid the film without effects is the answer, or the loop's first film.

What goes on in time, or has no derivatives, is solved on a coarse grid with all its effects, and once without each: at most as
many coarse films as `SHARE` of the work allows; small grids have all effects. In time the largest change over the whole march
counts, in parts of the largest value.
"""

from dataclasses import replace
from pathlib import Path
from time import perf_counter

from ...errors import InputError
from ...problems.solution import Solution
from ...scenes.effects.named import check_names, named, sentence
from ...scenes.scene import Scene, Solvable
from ..ask import Ask
from ..compose import Inner


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the scene names effects, of which some may be left out."""
    return (isinstance(scene, Scene) and bool(named(scene))) or ask.model not in ("auto", "full", "least")


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The solution with those effects that count. Collective.

    Returns
    -------
    Solution : settings['model'] has what was kept and left out, with effects (dQ/Q) where they were taken.

    Raises
    ------
    InputError : effects named that there are not, or that the scene has no data for.
    """
    from .look import Look  # here: what it needs is much, and few scenes name effects

    names = named(scene)
    begin = perf_counter()
    look = Look(scene, names, ask, inner)
    if ask.model in ("full", "least"):
        look.kept, look.record = (names if ask.model == "full" else []), {"reason": f"{ask.model} model asked for"}
    elif ask.model != "auto":
        look.kept = [word.strip() for word in ask.model.split(",")]
        check_names(look.kept)
        for name in look.kept:
            if name not in names:
                has = f"it has {', '.join(names)}" if names else "it has none"
                raise InputError(f"--model {name}: scene {scene.name} has no data for it; {has}")
        look.record = {"reason": "named"}
    else:
        look.decide()
        if ask.resume is not None:
            from ..checkpoint_file import read_header  # here, as above

            look.taken_up(read_header(Path(ask.resume), ask.mpi)[0].get("effects", ()))
    spent = perf_counter() - begin
    solution = look.solution or inner(look.reduced, look.ask)
    while look.doubtful and solution.converged:
        begin = perf_counter()
        more = look.again(solution)
        spent += perf_counter() - begin
        if not more:
            break
        solution.destroy()
        solution = inner(look.reduced, replace(ask, resume=None))
    look.destroy()
    if ask.start is None and "start" in solution.settings:
        solution.settings["start"] = "cold"  # what it started from is its own
    record = look.record
    if "quantity" in record:
        record["share_of_work"] = look.work / total_work(solution)
        record["seconds"] = spent
    gone = [name for name in names if name not in look.kept]
    model = {
        "kept": {name: look.effects.get(name) for name in names if name in look.kept},
        "left_out": {name: look.effects.get(name) for name in gone},
        **record,
    }
    solution.settings["model"] = model
    solution.because(f"model: {sentence(model)}", after=True)
    return solution


def total_work(solution: Solution) -> float:
    """Unknowns times solves: of all films of the last balance step, times its steps."""
    each = solution.settings.get("details", {}).get("coupling_work", solution.problem.unknowns)
    return each * solution.settings.get("balance", {}).get("solves", 1)
