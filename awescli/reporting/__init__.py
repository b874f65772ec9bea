"""Floor 6: shows artifacts: data in, an HTML string out. Computes no score, writes no file, prints nothing."""
