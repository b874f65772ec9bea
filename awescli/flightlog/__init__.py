"""Floor 1: flight logs. Reads flights, converts units; writes nothing, knows no physics.

The way in is `read.read_flight(folder)`; then `quality.data_quality`, `phases.phases`, `loops.find_loops`, `split.split`,
`split.segments`. The way out is `kitemill_csv.to_kitemill_csv`, as text.
"""
