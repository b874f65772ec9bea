"""Floor 0: what the letters mean. States, units, frames, parameters, errors; no files, no solvers."""
