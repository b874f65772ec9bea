"""Floor 4: what logs teach us about parameters and control laws. Changes parameters; writes and prints nothing."""
