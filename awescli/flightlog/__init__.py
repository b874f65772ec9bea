"""Floor 1: flight logs. Reads flights, converts units; writes nothing, knows no physics."""
