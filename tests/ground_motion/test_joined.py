"""Records of a sequence: the rest between them, and the joined record."""

import numpy as np
import pytest

from tdint import Record
from tdint.errors import UsageError
from tdint.ground_motion.joined import join_records, rest_intervals


def record(*samples):
    return Record(np.array(samples), 0.1, "", "a", "HN1", "a.txt")


@pytest.mark.parametrize(("rest", "intervals"), [(0.0, 1), (0.05, 1), (0.3, 3), (0.31, 4)])
def test_the_rest_is_at_least_one_interval(rest, intervals):
    assert rest_intervals(rest, 0.1) == intervals


@pytest.mark.parametrize("rest", [-0.1, np.inf, np.nan])
def test_a_rest_that_is_no_duration_is_refused(rest):
    with pytest.raises(UsageError, match="non-negative number of seconds"):
        rest_intervals(rest, 0.1)


def test_the_joined_record_ends_with_the_last_record():
    joined = join_records([record(1.0, 2.0, 3.0), record(4.0, 5.0)], [0, 5])
    assert joined.acceleration.tolist() == [1.0, 2.0, 3.0, 0.0, 0.0, 4.0, 5.0]
