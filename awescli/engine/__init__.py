"""Floor 1: record a scalar function, differentiate it, print it as machine code, run it over many lanes.

Knows no kite: it sees functions of numbers. `record.py` -> `derive.py` -> `llvm_ir.py`, `linearised.py` -> `machine.py`;
`lanes.py`: segments side by side.
"""
