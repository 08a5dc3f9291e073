"""Formats of single national networks, each a plugin as `tdint.ground_motion.formats` describes."""
