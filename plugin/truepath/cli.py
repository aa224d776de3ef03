"""The command ``truepath``: thin, and quick to start because heavy imports wait until they are needed."""

from __future__ import annotations

import sys
import traceback
from typing import Annotated

import typer

from truepath import (
    __version__,
    cli_controller,
    cli_deploy,
    cli_learning,
    cli_plan,
    cli_programs,
    cli_record,
    cli_virtual,
)
from truepath.errors import TruepathError

app = typer.Typer(
    name="truepath",
    epilog="Exit codes: 0 good, 1 a stated bound was missed, 2 bad input.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"truepath {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="print the version and stop")
    ] = False,
) -> None:
    """Measure a robot, learn where it really goes, correct its offline programs, prove the gain."""


for command in (  # in the order of the flow
    cli_plan.plan,
    cli_record.record,
    cli_learning.calibrate,
    cli_learning.diagnose,
    cli_learning.validate,
    cli_programs.correct,
    cli_programs.preview,
    cli_deploy.deploy,
    cli_programs.export,
    cli_virtual.simulate,
    cli_controller.controller,
    cli_virtual.demo,
):
    app.command()(command)


def main() -> None:
    """Entry point: errors that a user can cause end in one clear message and exit code 2."""
    try:
        app()
    except TruepathError as error:
        from truepath.console import complain

        complain(f"error: {error}")
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception:  # a fault of truepath itself must not look like a missed bound
        traceback.print_exc()
        sys.exit(3)
