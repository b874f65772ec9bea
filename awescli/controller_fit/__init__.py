"""Floor 3: laws fitted to logs: what moves the surfaces, and the winch. Simulates nothing; writes and prints nothing."""
