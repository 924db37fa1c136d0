"""Pictures of results: they take a curve, a response, a body, and write a file whole."""

from ..base.isolation import load

load("matplotlib")  # before any module here imports a part of it
