"""The judge: residuals, loads, energy, metrics and truth from poses alone, without engine or model."""
