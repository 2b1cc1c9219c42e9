"""The program: what the command `oscura` and `python -m oscura` run."""

import signal
import sys

from ._oscura import run_program


def main() -> int:
    # The program looks after Ctrl-C itself: it writes what it has and ends.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return run_program(["oscura", *sys.argv[1:]])
