"""Open gmsh: a context manager for a quiet session with an empty model, which is always closed.

gmsh keeps its state in globals of a shared library: one session at a time (a lock holds a second thread back), nothing
left behind. Geometry is built in millimetres, because gmsh's CAD kernel has an absolute tolerance of 1e-7.
"""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import ModuleType
from typing import Any

from ...base.errors import MissingLibraryError

#: Debian and Ubuntu packages whose shared libraries the gmsh wheel opens on import.
DEBIAN_PACKAGES = "libglu1-mesa libgl1 libegl1 libxft2 libxcursor1 libxinerama1 libgomp1"

_LOCK = threading.RLock()


def import_gmsh() -> ModuleType:
    """Import gmsh, with an error that says how to fix a bare system.

    Raises
    ------
    MissingLibraryError
        When the package is absent or a shared library that it opens is.
    """
    try:
        import gmsh
    except ImportError as error:
        raise MissingLibraryError(f"gmsh cannot be imported ({error}); install it: pip install gmsh") from error
    except OSError as error:
        raise MissingLibraryError(
            f"gmsh is installed but a system library is missing ({error}); on Debian or Ubuntu: "
            f"apt-get install {DEBIAN_PACKAGES}"
        ) from error
    return gmsh


@contextmanager
def _pipes_as_before() -> Iterator[None]:
    """Keep what SIGPIPE does: gmsh sets it so that a pipe whose other end went away ends the program.

    Python makes an error of such a pipe, by which a pool of processes learns that one of them died. `signal.signal`
    would do in the main thread only.
    """
    if not hasattr(signal, "SIGPIPE"):
        yield
        return
    get, set_ = ctypes.pythonapi.PyOS_getsig, ctypes.pythonapi.PyOS_setsig
    get.restype = set_.restype = ctypes.c_void_p
    get.argtypes, set_.argtypes = [ctypes.c_int], [ctypes.c_int, ctypes.c_void_p]
    before = get(signal.SIGPIPE)
    try:
        yield
    finally:
        set_(signal.SIGPIPE, before)


@contextmanager
def gmsh_session(name: str = "gearfe", *, options: Mapping[str, float] | None = None) -> Iterator[Any]:
    """Yield the gmsh module with a fresh model called `name`; quiet, on one thread, closed again on the way out.

    With one thread meshes are the same on every run. The exception is the anisotropic mesher of the housing, whose
    meshes depend on the memory addresses of its vertices.

    If the calling program already has gmsh open, only the model is added and removed again. The options of that session
    do not change.

    Parameters
    ----------
    name
        Name of the model.
    options
        gmsh's numeric options for this session.

    Raises
    ------
    MissingLibraryError
        When gmsh cannot be imported.
    """
    gmsh = import_gmsh()
    with _LOCK:
        ours = not gmsh.isInitialized()
        if ours:
            with _pipes_as_before():
                gmsh.initialize(interruptible=False, readConfigFiles=False)
        settings = {
            "General.Terminal": 0.0,
            "General.Verbosity": 1.0,
            "General.NumThreads": 1.0,
            "Mesh.RandomSeed": 1.0,
            **(options or {}),
        }
        before = {} if ours else {key: gmsh.option.getNumber(key) for key in settings}
        try:
            for key, value in settings.items():
                gmsh.option.setNumber(key, value)
            gmsh.model.add(name)
            yield gmsh
        finally:
            if ours:
                gmsh.finalize()
            else:
                gmsh.model.remove()
                for key, value in before.items():
                    gmsh.option.setNumber(key, value)
