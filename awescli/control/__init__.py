"""Floor 2: flight controllers. What the surfaces do at one instant, given the state; knows no kite, no log file, no solver."""
