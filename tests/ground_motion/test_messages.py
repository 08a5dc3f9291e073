"""Import of ObsPy."""

import subprocess
import sys

CODE = """
import sys
from tdint.ground_motion.messages import quiet_import
with quiet_import():
    from obspy.core.event import event
assert "matplotlib" not in sys.modules
assert "obspy.imaging.source" not in sys.modules
try:
    event.plot_radiation_pattern("no tensor")
except Exception:
    pass
assert "obspy.imaging.source" in sys.modules
"""


def test_the_module_that_plots_earthquakes_is_imported_when_it_is_called():
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
