"""Files of other programs: every reader and writer of a foreign format; readers return arrays and plain records."""
