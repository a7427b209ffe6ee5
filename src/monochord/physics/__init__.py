"""Physics of the string: closed forms and simulators."""
