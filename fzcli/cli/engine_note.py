"""The one line that says what runs the loops when it is not compiled code."""

from fzcli.cli.guard import say


def note_engine(quiet: bool = False) -> None:
    """Say that there is no C compiler, where there is none."""
    from fzcli.loop.compiler import find_compiler

    if not quiet and find_compiler() is None:
        say("no C compiler: runs go through CasADi's virtual machine, slower (FZCLI_CC names a compiler)")
