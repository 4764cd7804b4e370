"""Generated source becomes a module: from the user's cache where there is one, else from memory."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.abc
import importlib.util
import os
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Final

FOLDER: Final = "AFFORDANT_CACHE"
"""Environment variable that names the folder of the kernels; the user's cache folder if it is not set."""


def cache_folder() -> Path:
    """Return the folder in which generated kernels are kept; deleting it costs their compilation, no more.

    Examples
    --------
    >>> cache_folder().name
    'affordant'
    """
    chosen = os.environ.get(FOLDER)
    if chosen:
        return Path(chosen)
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "affordant"


def build(source: str) -> ModuleType:
    """Return the module of a generated source, whose kernels are compiled once for every user and machine.

    The source stands in a file named by its hash, and what numba made of it beside that. A file that holds
    anything else is written anew; where nothing can be written the module lives in memory alone.
    """
    name = f"affordant_kernel_{hashlib.sha256(source.encode()).hexdigest()[:16]}"
    if name not in sys.modules:
        loader: importlib.abc.Loader = _Memory(source)
        with contextlib.suppress(OSError, RuntimeError):  # RuntimeError: there is no home folder
            loader = importlib.machinery.SourceFileLoader(name, str(_written(name, source)))
        spec = importlib.util.spec_from_loader(name, loader)
        assert spec is not None, "a loader was given"
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # numba finds a kernel's module by its name
        try:
            loader.exec_module(module)
        except BaseException:
            del sys.modules[name]
            raise
    return sys.modules[name]


def _written(name: str, source: str) -> Path:
    """Return the path of a file that holds the source, writing it if it does not, at once or not at all."""
    folder = cache_folder()
    path = folder / f"{name}.py"
    with contextlib.suppress(OSError, UnicodeDecodeError):
        if path.read_text(encoding="utf-8") == source:
            return path
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=folder, suffix=".tmp")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(source)
        Path(temporary).replace(path)
    except OSError:
        Path(temporary).unlink(missing_ok=True)
        raise
    return path


class _Memory(importlib.abc.SourceLoader):
    """Loads a module from its text."""

    def __init__(self, source: str) -> None:
        self.source = source

    def get_filename(self, fullname: str) -> str:
        return f"<{fullname}>"

    def get_data(self, path: str | bytes) -> bytes:  # noqa: ARG002 - the loader's form
        return self.source.encode()
