"""Commands on ground motions."""
