"""People of live worlds: workers, pedestrians, dragged people."""
