"""What every package may use: mistakes of users, files, tables of job files, expressions, spectra, progress."""
