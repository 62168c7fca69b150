"""What the link bench is made of: other hosts to compare with, and how each is run."""
