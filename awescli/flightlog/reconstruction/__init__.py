"""Flight-path reconstruction: what sensors say of each other, without a model of forces. The way in is `flight_path.reconstruct`."""
