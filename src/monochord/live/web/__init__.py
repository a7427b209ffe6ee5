"""The page: a server that shows a live run in browsers, and passes touches to a simulated string."""
