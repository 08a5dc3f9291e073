"""Import path of the programs of the validation page, which import each other by name, as scripts
of one directory do."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
