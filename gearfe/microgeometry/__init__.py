"""Microgeometry: what deviations of micrometres do to a loaded pair, and the relief that does it best."""
