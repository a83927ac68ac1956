"""Checkpoints of a march in time: what its next step starts from, written after every so many steps (`checkpoint_file`)."""

from typing import Any

import numpy as np

from ...errors import InputError
from ...problems.certificate import Certificate
from ...problems.grid import Grid
from ...problems.solution import Step
from .. import checkpoint_file
from ..ask import Ask
from ..checkpoint import Checkpointer, load, scene_record

NUMBERS = ("t", "dts", "volumes", "flowed", "stored", "moved", "rates", "warming", "lapse")  # of a `March`
ARRAYS = ("contents", "carried", "full")
RUN = ("history", "solves", "lengths", "step", "rescuer", "times_s", "settings")  # of what takes the steps


class MarchFile:
    """Writes a run's checkpoints, and takes one up. Every method is collective.

    Raises
    ------
    InputError : a file that cannot be written.
    """

    def __init__(self, ask: Ask, scene: Any):
        self.keeper = Checkpointer(ask.checkpoint, ask.every, ask.mpi)
        self.resume, self.scene = ask.resume, scene_record(scene)
        self.scene.get("motion", {}).pop("t_end", None)  # a march may go on beyond its first end
        self.comm = ask.mpi

    def after(self, run: Any) -> None:
        """A step was taken; raises as `Checkpointer.after_step`."""
        self.keeper.after_step(lambda: self._write(run), run.done)

    def _write(self, run: Any) -> None:
        march, rotor = run.march, run.rotor
        arrays = [(f"{name}.{k}", np.asarray(a, dtype=float)) for name in ARRAYS for k, a in enumerate(getattr(march, name))]
        arrays += [(f"fields.{k}.{name}", a) for k, fields in enumerate(march.fields) for name, a in fields.items()]
        seen, more = run.seen.state() if run.seen is not None else ({}, [])
        arrays += [(f"seen.{k}", a) for k, a in enumerate(more)]
        worst = run.worst()
        header = {
            "scene": self.scene,
            "march": {name: getattr(march, name) for name in NUMBERS},
            "rotor": None if rotor is None else {
                "places": [[*map(float, e)] for e in rotor.places],
                "speeds": [[*map(float, e)] for e in rotor.speeds],
                "size": rotor.size,
                "K": None if rotor.K is None else rotor.K.tolist(),
                "weight": rotor.weight,
            },
            "worst": [worst.measures, worst.tol, worst.extremes],
            "seen": seen,
            "run": {name: getattr(run, name) for name in RUN},
        }  # fmt: skip
        self.keeper.write(march.grid, header, arrays, run.steps)

    def restore(self, run: Any, grid: Grid) -> bool:
        """Put the run where the file has it; False without one.

        Raises
        ------
        InputError : no checkpoint of this march, one cut short or damaged.
        """
        if self.resume is None:
            return False
        saved = load(self.resume, self.scene, self.comm)
        header = saved.record
        if "march" not in header:
            raise InputError(f"--resume {self.resume}: no checkpoint of a march in time")
        arrays = checkpoint_file.read_arrays(saved.path, grid, header, saved.start)
        for name, value in header["march"].items():
            setattr(run.march, name, value)
        run.march.contents = [a for name, a in arrays.items() if name.startswith("contents.")]
        run.march.carried = [a for name, a in arrays.items() if name.startswith("carried.")]
        run.march.full = [a > 0.5 for name, a in arrays.items() if name.startswith("full.")]
        count = sum(name.startswith("fields.") for name in arrays) // 2
        run.march.fields = [{name: arrays[f"fields.{k}.{name}"] for name in ("p", "r")} for k in range(count)]
        if run.rotor is not None:
            for name in ("places", "speeds"):
                setattr(run.rotor, name, [np.array(e) for e in header["rotor"][name]])
            run.rotor.size, run.rotor.weight = header["rotor"]["size"], header["rotor"].get("weight", 0.0)
            run.rotor.K = None if (K := header["rotor"].get("K")) is None else np.array(K)
        if run.seen is not None:
            run.seen.restore(header["seen"], [a for name, a in arrays.items() if name.startswith("seen.")])
        run.certificates = [Certificate(*header["worst"])]
        run.steps = [Step(*step) for step in header["steps"]]
        for name, value in header["run"].items():
            setattr(run, name, value)
        return True
