"""What goes over the wire: one pydantic model per direction, units in the descriptions."""
