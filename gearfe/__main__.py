"""``python -m gearfe`` is the ``gearfe`` program."""

import sys

from .base.isolation import leave_working_folder

if __name__ == "__main__":
    leave_working_folder(module=True)  # before anything else is imported

    from .cli.main import main

    sys.exit(main())
