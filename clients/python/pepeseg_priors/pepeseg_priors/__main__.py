"""python -m pepeseg_priors"""

import sys

from pepeseg_priors.cli import main

if __name__ == "__main__":
    sys.exit(main())
