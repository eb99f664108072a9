"""What the operators and the command line run: the pipeline, background jobs, the live session, models."""
