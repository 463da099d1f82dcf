"""The whole C text of a closed loop: lanes header, printed functions, driver."""

from importlib.resources import files

from fzcli.loop.printer import print_function
from fzcli.loop.rollable import Rollable


def c_source(loop: Rollable) -> str:
    """One self-contained C file; LANES is given to the compiler. Names in it are our own, never the spec's."""
    here = files("fzcli.loop") / "c"
    sizes = {
        "N_PARAMETERS": loop.initial.size1_in(0),
        "N_STATE": loop.step.size1_in("state"),
        "N_CONSTANTS": loop.step.size1_in("constants"),
        "N_SAMPLES": loop.step.size1_out("samples"),
        "N_SIGNALS": loop.step.size1_out("signals"),
        "N_METRICS": loop.finish.size1_out("metrics"),
        "HISTORY_LENGTH": loop.history_length,
    }
    return "\n".join(
        [
            (here / "lanes.h").read_text(encoding="ascii"),
            print_function(loop.initial, "fzcli_initial", once=True),
            print_function(loop.step, "fzcli_closed_loop_step"),
            print_function(loop.finish, "fzcli_finish", once=True),
            *(f"#define {name} {value}" for name, value in sizes.items()),
            (here / "driver.h").read_text(encoding="ascii"),
        ]
    )
