"""Large sparse models to small modal bodies: factorisations, Lanczos, Craig-Bampton, the error of the reduction."""
