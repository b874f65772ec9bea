"""Floor 2: one instant of a tethered kite. Loads in, derivatives out; no time, no files (but the kite file), no solvers."""
