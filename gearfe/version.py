"""Version of the package: results that are kept on disk name it."""

VERSION = "0.1.0"
