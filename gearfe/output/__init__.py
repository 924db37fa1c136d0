"""Files that leave the program: tables, figures, VTK series. Each heavy library is imported inside the function."""
