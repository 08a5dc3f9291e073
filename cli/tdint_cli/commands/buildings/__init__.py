"""Commands on buildings."""
