"""The page: a server that shows a live run in browsers, and passes their touches on to a simulated string."""
