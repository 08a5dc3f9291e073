"""Campaigns: runs of many buildings under many ground motions, their tables, figures and report."""
