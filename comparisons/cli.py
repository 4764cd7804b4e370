"""The command line `affordant`: its commands, and what becomes of errors. Nothing heavy is loaded here."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from importlib.metadata import version

from cyclopts import App, CycloptsError

from comparisons.commands.experiment import doctor, reproduce
from comparisons.commands.graphs import check, draw, maze
from comparisons.commands.learn import learn
from comparisons.commands.perception import compare_perception, perceive, train_perception
from comparisons.stopping import orderly_exit
from comparisons.study.command import study
from worlds.errors import UserError

app = App(
    name="affordant",
    help="Learn, plan and prove affordances of hierarchical tasks.",
    version=lambda: version("affordant"),
    help_format="plaintext",
    suppress_keyboard_interrupt=False,  # `main` says how it ends
)
for _command in (reproduce, doctor, check, draw, maze, learn, perceive, train_perception, compare_perception):
    app.command(_command)
app.command(study)


def main(tokens: Sequence[str] | None = None) -> None:
    """Run the command line; a user's mistake is one message and exit status 2, never a traceback.

    Ctrl-C ends it with status 130 and SIGTERM with 143; what was half-made is taken away first.
    """
    try:
        with orderly_exit():
            status = app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
            sys.stdout.flush()
    except (CycloptsError, UserError) as error:
        print(f"affordant: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:  # a command that has more to say than that it was stopped has said it
        sys.exit(130)
    except BrokenPipeError:  # whoever read the output, such as head, has had enough of it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what is flushed at the end
        sys.exit(128 + signal.SIGPIPE)
    sys.exit(status or 0)
