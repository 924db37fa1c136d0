"""Pictures of results: they take a curve, a response, a body, and write a file whole."""

import os

from ..base.isolation import EMPTY, load

load("matplotlib")  # before any module here imports a part of it

if os.environ.get("MATPLOTLIBRC", "").startswith(EMPTY):  # the program, not an interpreter in which somebody reads help
    from matplotlib import artist

    # signatures and docstrings that list all properties of each artist take a third of the time that matplotlib loads
    artist.kwdoc = lambda artist: ""  # noqa: ARG005
    setattr(artist.Artist, "_update_set_signature_and_docstring", classmethod(lambda artist: None))  # noqa: ARG005, B010
