"""Signal processing: pure functions, arrays in, arrays out."""
