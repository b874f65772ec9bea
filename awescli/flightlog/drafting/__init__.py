"""A first flight.yaml for a log of unknown layout: what the header says, held against what the numbers do."""
