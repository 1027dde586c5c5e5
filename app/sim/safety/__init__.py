"""Speed and separation monitoring; power and force limiting."""
