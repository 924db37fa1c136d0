"""``python -m gearfe`` is the ``gearfe`` program."""

import sys

from .cli import main

sys.exit(main())
