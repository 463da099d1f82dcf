"""C text to a loaded library: which compiler, which flags, and a cache under the user's own folder."""

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fzcli.errors import EngineError
from fzcli.loop.file_lock import locked_briefly

FLAGS = (
    "-O2",
    "-std=gnu11",
    "-fPIC",
    "-shared",
    "-fvisibility=hidden",
    "-ffp-contract=off",  # no fused multiply-add: the same bits on every host
    "-fno-math-errno",
    "-fno-trapping-math",
    "-Wno-psabi",
)
GCC_FLAGS = (
    "-fschedule-insns",  # worth a tenth on a thousand vector instructions in a row
    "-fno-tree-slp-vectorize",  # gcc 12 makes fmaddsub of scalar a * b -+ c pairs, whatever -ffp-contract says
)
ISA_FLAGS = {"avx512": ("-march=x86-64-v4",), "avx2": ("-march=x86-64-v3",), "baseline": ()}
ISA_LANES = {"avx512": 8, "avx2": 4, "baseline": 2}


@dataclass(frozen=True)
class Compiler:
    """A C compiler: the words that call it, and what identifies it in the cache."""

    command: tuple[str, ...]
    identity: str

    @property
    def gcc(self) -> bool:
        """Whether it takes gcc's own scheduling options."""
        return "gcc" in self.identity.lower() or "free software foundation" in self.identity.lower()


@cache
def find_compiler() -> Compiler | None:
    """The C compiler to use: $FZCLI_CC, $CC, then cc, gcc, clang, zig; None where there is none.

    ``FZCLI_CC=none`` asks for none. Raises EngineError when $FZCLI_CC names one that does not run.
    """
    asked = os.environ.get("FZCLI_CC", "")
    if asked == "none":
        return None
    if asked:
        compiler = identify(tuple(shlex.split(asked)))
        if compiler is None:
            raise EngineError(f"FZCLI_CC={asked}: this compiler does not run")
        return compiler
    candidates = [shlex.split(os.environ["CC"])] if os.environ.get("CC") else []
    candidates += [["cc"], ["gcc"], ["clang"], ["zig", "cc"]]
    for words in candidates:
        found = identify(tuple(words))
        if found is not None:
            return found
    return None


@cache
def identify(command: tuple[str, ...]) -> Compiler | None:
    """The compiler behind a command line, by what it says of its version; None when it does not run."""
    program = shutil.which(command[0])
    if program is None:
        return None
    try:
        said = subprocess.run([program, *command[1:], "--version"], capture_output=True, text=True, timeout=30)
    except (OSError, subprocess.TimeoutExpired):
        return None
    if said.returncode != 0:
        return None
    return Compiler((program, *command[1:]), said.stdout.strip())


@cache
def host_isa() -> str:
    """The widest of avx512, avx2 and baseline that this machine runs."""
    if platform.machine().lower() not in ("x86_64", "amd64") or not sys.platform.startswith("linux"):
        return "baseline"
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace")
    except OSError:
        return "baseline"
    flags = set(next((line for line in text.splitlines() if line.startswith("flags")), "").split())
    if {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"} <= flags:
        return "avx512"
    return "avx2" if {"avx2", "bmi2", "fma"} <= flags else "baseline"


def cache_folder() -> Path:
    """Where compiled steps are kept: $FZCLI_CACHE_DIR, or fzcli under the user's cache folder; made with mode 0700.

    Raises EngineError when somebody else owns the folder or may write to it: its code would be run.
    """
    asked = os.environ.get("FZCLI_CACHE_DIR")
    if asked:
        folder = Path(asked)
    elif sys.platform == "win32":
        folder = Path(os.environ.get("LOCALAPPDATA", Path.home())) / "fzcli" / "cache"
    elif sys.platform == "darwin":
        folder = Path.home() / "Library" / "Caches" / "fzcli"
    else:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fzcli"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise EngineError(_no_cache(folder, error)) from error
    if hasattr(os, "getuid"):
        found = folder.stat()
        if found.st_uid != os.getuid():
            raise EngineError(f"{folder}: the cache belongs to another user; set FZCLI_CACHE_DIR")
        if found.st_mode & 0o022:
            raise EngineError(f"{folder}: others may write to the cache; chmod go-w it or set FZCLI_CACHE_DIR")
    return folder


def _no_cache(folder: Path, error: OSError) -> str:
    why = error.strerror or str(error)
    return f"{folder}: compiled loops cannot be kept here: {why}; name a writable folder with FZCLI_CACHE_DIR"


def build_library(
    source: str, lanes: int, compiler: Compiler, isa: str, folder: Path | None = None
) -> ctypes.CDLL:
    """Compile C text (or take it from the cache, or the ``folder`` that stands for it) and load it.

    The cache is keyed by the hash of source, flags and compiler; a file whose checksum does not
    match is compiled again. Raises EngineError with the compiler's own words when it fails.
    """
    flags = [*FLAGS, *(GCC_FLAGS if compiler.gcc else ()), *ISA_FLAGS[isa], f"-DLANES={lanes}"]
    text = "\0".join([source, *flags, *compiler.command, compiler.identity, platform.machine()])
    key = hashlib.sha256(text.encode()).hexdigest()[:40]
    folder = folder or cache_folder()
    library, checksum = folder / f"{key}.so", folder / f"{key}.sha256"
    if not _intact(library, checksum):
        try:
            with locked_briefly(folder / f"{key}.lock"):  # one process compiles, the others wait for it
                if not _intact(library, checksum):
                    _compile(source, flags, compiler, library, checksum)
        except OSError as error:
            raise EngineError(_no_cache(folder, error)) from error
    return ctypes.CDLL(str(library))


def _intact(library: Path, checksum: Path) -> bool:
    try:
        return hashlib.sha256(library.read_bytes()).hexdigest() == checksum.read_text(encoding="ascii").strip()
    except OSError:
        return False


def _compile(source: str, flags: list[str], compiler: Compiler, library: Path, checksum: Path) -> None:
    with tempfile.TemporaryDirectory(dir=library.parent, prefix="build-") as scratch:
        built = Path(scratch) / "step.so"
        (Path(scratch) / "step.c").write_text(source, encoding="ascii")
        command = [*compiler.command, *flags, "-o", "step.so", "step.c"]
        done = subprocess.run(command, cwd=scratch, capture_output=True, text=True)
        if done.returncode != 0:
            raise EngineError(f"{' '.join(command)} failed:\n{done.stderr[-2000:].strip()}")
        if not built.is_file():
            raise EngineError(f"{' '.join(command)} wrote no library: is this a C compiler?")
        digest = Path(scratch) / "digest"
        digest.write_text(hashlib.sha256(built.read_bytes()).hexdigest() + "\n", encoding="ascii")
        os.replace(built, library)
        os.replace(digest, checksum)
