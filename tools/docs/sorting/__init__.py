"""Tables, pictures and studies of the sorting scenario."""
