"""Runs of buildings by the thousand: a chunk of them in one compiled call for each building, on threads or far away."""
