"""Oscillators under a record, exactly: elastic, rotated, bilinear, and sums of modes."""
