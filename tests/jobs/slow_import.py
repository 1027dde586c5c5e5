"""A module whose import takes long, as that of a learning library does on a busy machine."""

import time

time.sleep(3600.0)
