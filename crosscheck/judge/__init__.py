"""The judge computes residuals, loads, energy, metrics and truths from poses alone. It uses no engine and no
code of mbref's methods."""
