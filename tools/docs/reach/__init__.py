"""Tables, pictures and studies of the reach scenario."""
