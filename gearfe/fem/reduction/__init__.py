"""Reduce large sparse models to small modal bodies: factorisation, Lanczos, Craig-Bampton, error estimate."""
