"""How a command ends: every error becomes one message on standard error and an exit code."""

import contextlib
import functools
import os
import shlex
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, TypeVar

import typer

from fzcli.errors import FzcliError, UnfinishedError

FAILED = 1
received: list[int] = []  # signals that asked this process to end


class OutputError(FzcliError):
    """Standard output takes no more, as on a full disk."""

    exit_code = FAILED


F = TypeVar("F", bound=Callable[..., None])


def guarded(command: F) -> F:
    """The command, with errors told in a line and turned into exit codes; FZCLI_DEBUG=1 lets them through.

    A reader that closes the pipe early has what it wanted: the command ends quietly.
    """

    @functools.wraps(command)
    def run(*args: Any, **options: Any) -> None:
        code = 0
        try:
            command(*args, **options)
            if sys.stdout is not None:
                sys.stdout.flush()
        except BrokenPipeError:
            discard_output()
        except OutputError as error:
            discard_output()
            say_error(str(error))
            code = FAILED
        except KeyboardInterrupt:
            say("interrupted")
            code = 128 + signal.SIGINT
        except UnfinishedError as error:
            say(f"{error}; go on with: {shlex.join(('fzcli', *sys.argv[1:]))}")
            code = error.exit_code
        except FzcliError as error:
            if debugging():
                raise
            say_error(str(error))
            code = error.exit_code
        except (typer.Exit, SystemExit):
            raise
        except Exception as error:
            if received:  # CasADi's C++ turns an exception that a signal raised inside it into one of its own
                say("interrupted")
                raise typer.Exit(128 + received[0]) from None
            if debugging():
                raise
            text = str(error).strip().partition("\n")[0]
            say_error(f"unexpected {type(error).__name__}: {text} (FZCLI_DEBUG=1 shows the traceback)")
            code = FAILED
        if code:
            raise typer.Exit(code)

    return run  # type: ignore[return-value]


def debugging() -> bool:
    """Whether the user asked for tracebacks."""
    return os.environ.get("FZCLI_DEBUG", "") not in ("", "0")


def say(text: str, quiet: bool = False) -> None:
    """A message for the user on standard error, unless ``quiet``; never an error of its own."""
    if not quiet:
        with contextlib.suppress(BrokenPipeError):
            typer.echo(f"fzcli: {text}", err=True)


def say_error(text: str) -> None:
    """Every problem as it is, a line (and its source line) each."""
    with contextlib.suppress(BrokenPipeError):
        typer.echo(f"error: {text}", err=True)


def emit(text: str) -> None:
    """Data to standard output; when its reader has gone, the command goes on without it."""
    if sys.stdout is None:  # closed by the shell: >&-
        return
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        discard_output()
    except OSError as error:
        raise OutputError(f"standard output cannot be written: {error.strerror or error}") from error


def discard_output() -> None:
    """Point standard output at nothing, so that Python's own flush at exit stays quiet."""
    with contextlib.suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)


def end_on_signals() -> None:
    """Let SIGINT and SIGTERM unwind the stack, so that temporary files go, and end with 130 and 143."""

    def stop(number: int, frame: FrameType | None) -> None:
        received.append(number)
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + number)

    signal.signal(signal.SIGTERM, stop)
    signal.signal(signal.SIGINT, stop)
