"""The error of a run of moment4, carried along in the run."""
