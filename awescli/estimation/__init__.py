"""Floor 4: what logs teach us about parameters. Changes parameters; writes and prints nothing."""
