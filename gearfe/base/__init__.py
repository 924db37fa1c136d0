"""Provide the basis of all packages: user errors, files, tables of job files, expressions, spectra, progress."""
