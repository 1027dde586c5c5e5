"""Arrays, compilation, random numbers, trigonometry."""
