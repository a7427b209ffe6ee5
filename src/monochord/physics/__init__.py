"""The physics of the string: closed forms and simulators."""
