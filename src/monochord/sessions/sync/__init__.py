"""One clock: when readings were taken, and by how much streams are apart."""
