"""Scripts that measure, draw and write the result pages of ``docs``."""
