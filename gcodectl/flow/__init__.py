"""Flow: basis tasks, their learned signals, and how they are put in sequence."""
