"""The equations of a step, and how they are solved."""
