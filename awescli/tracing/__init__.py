"""Floor 5: what a residual still holds, traced to the effect that the model lacks. Changes no model but its own candidates."""
