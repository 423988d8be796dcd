"""``python -m thud.cli``."""

import sys

from thud.cli import main

sys.exit(main())
