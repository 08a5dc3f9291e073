"""What holds for all tests: hypothesis does not judge how fast the machine is."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

# Older versions of hypothesis take one slow draw, the first one on a busy machine, for a fault of the test.
settings.register_profile("tdint", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("tdint")
