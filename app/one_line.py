"""Text of one line, such as names and titles from outside."""

ONE_LINE = r"^[^\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]*$"
"""Pattern of text without control characters, separators of lines and controls of direction."""
