"""Array types of the simulator."""

import numpy as np
from numpy.typing import NDArray

Vec = NDArray[np.float64]
