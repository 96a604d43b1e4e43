"""What the verbs on live data stand on: who is there, what is said, how often, how to show it and how to say it."""
