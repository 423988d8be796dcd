"""``python -m thud``."""

import sys

from thud_driver import main

sys.exit(main())
