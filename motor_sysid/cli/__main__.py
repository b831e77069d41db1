"""``python -m motor_sysid.cli``, the same as ``motor-sysid``."""

import sys

from motor_sysid.cli import main

sys.exit(main())
