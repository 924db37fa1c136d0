"""Pictures of results: they take a curve, a response, a body, and write a file whole."""
