"""The world of several arms: compiled episodes, disturbances, the simulation."""
