"""``python -m thud.cli``."""

import sys

from thud_driver import main

sys.exit(main())
