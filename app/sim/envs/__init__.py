"""Gymnasium environments; importing this package registers their ids."""

import gymnasium

gymnasium.register(id="tandem/Pick-v0", entry_point="app.sim.envs.pick:PickEnv")
