"""Floor 3: the closed loop over time. The one home of ODE solving."""
