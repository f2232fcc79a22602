"""Ramp laws, one module each: from speeds and distances to a pulse train."""
