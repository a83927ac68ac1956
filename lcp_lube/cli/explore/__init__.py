"""`lcp-lube explore`: numbers of a scene as sliders on a local page, and answers to what the page asks until Ctrl-C."""

import argparse
import webbrowser

from mpi4py import MPI

from ...base.options import check_unread
from ...errors import InputError
from ...output.console import note, say
from ..asked import ask_of, scene_of
from .answers import Answers
from .server import Server


def run(args: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C; exit status 0."""
    if MPI.COMM_WORLD.size > 1:
        raise InputError("explore: a page is served by one rank; leave mpiexec out")
    if not 0 <= args.port < 65536:
        raise InputError(f"--port {args.port}: allowed are 0 (any free port) to 65535")
    scene, ask = scene_of(args), ask_of(args)
    trial, answers = Answers(scene, ask, args.accuracy), Answers(scene, ask, args.accuracy)
    for level in (0, 0, 1 - trial.moves):  # what cannot be solved is refused here; loops are compiled, a start's too
        trial.solve({}, level)
    trial.forget()
    check_unread()
    try:
        with Server(answers, args.port) as server:
            say(f"{answers.base.name}: {server.address}\nCtrl-C ends the page")
            if args.browser:
                webbrowser.open(server.address)
            server.serve()
    except KeyboardInterrupt:
        note("lcp-lube: the page has ended")
    return 0
