"""CasADi's own C of the plain formulation, compiled with full optimisation and driven by a bare C loop."""

import ctypes
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from plain_formulation import PlainLoop

FLAGS = ("-O3", "-march=native", "-fPIC", "-shared")
_DRIVER = """
#include "plain_step.c"
double drive(const double *start, const double *parameters, int runs, int steps)
{{
    static double state[2][{size}], work[{work}];
    static casadi_int integers[{integers}];
    double tip = 0, yaw = 0, oscillating = 0, sum = 0;
    for (int r = 0; r < runs; ++r) {{
        for (int i = 0; i < {size}; ++i) state[0][i] = start[i];
        sum = 0;
        for (int k = 0; k < steps; ++k) {{
            const double *arg[{args}] = {{state[k & 1], parameters}};
            double *res[{results}] = {{state[~k & 1], &tip, &yaw, &oscillating}};
            plain_step(arg, res, integers, work, 0);
            sum += tip;
        }}
    }}
    return sum / steps;
}}
"""


class CasadiC:
    """``drive(start, parameters, runs, steps)`` runs the loop and gives the mean tip error [m]."""

    def __init__(self, plain: PlainLoop, compiler: str) -> None:
        self._folder = tempfile.TemporaryDirectory()
        folder = Path(self._folder.name)
        plain.step.generate("plain_step.c", {"with_header": False, "cpp": False})
        Path("plain_step.c").replace(folder / "plain_step.c")
        args, results, integers, work = plain.step.sz_arg(), plain.step.sz_res(), plain.step.sz_iw(), plain.step.sz_w()
        text = _DRIVER.format(
            size=plain.state_size, args=args, results=results, integers=max(1, integers), work=max(1, work)
        )
        (folder / "driver.c").write_text(text)
        subprocess.run([compiler, *FLAGS, "-o", "driver.so", "driver.c", "-lm"], cwd=folder, check=True)
        self._drive = ctypes.CDLL(str(folder / "driver.so")).drive
        self._drive.restype = ctypes.c_double

    def drive(self, start: np.ndarray, parameters: np.ndarray, runs: int, steps: int) -> float:
        """Mean tip error of the last run."""
        start, parameters = np.ascontiguousarray(start), np.ascontiguousarray(parameters)
        return float(
            self._drive(
                ctypes.c_void_p(start.ctypes.data), ctypes.c_void_p(parameters.ctypes.data), runs, steps
            )
        )
