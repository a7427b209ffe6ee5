"""The laboratory: what stands in for people, robots and instruments, so that real devices can be tried."""
